/* The C twin of cra_sym/solvers/spectrum_lanes.py, step by step, for the benchmark alone. What stands before this text
   (elementary functions, derived kernels) is generated from the expressions the Python kernels are generated from. */

#define LANES 128
#define NEAR 5.0
#define PI 3.14159265358979323846

typedef double row[LANES];
typedef struct { row pair[8], k[12], h[TERMS]; long zeros[LANES]; } block;
typedef struct { double lam, z, basis[5]; } point;

static inline double smaller(double a, double b) { return a < b ? a : b; }

static inline void scaled_basis(double lam, double z, double *out) {
  double far[5], near[5];
  basis(lam, exp_(-lam), far);
  basis_near(smaller(z, NEAR), near);
  for (int i = 0; i < 5; i++) out[i] = z < NEAR ? near[i] : far[i];
}

static void prepare(block *b, const double *kt, const double *kr, const double *mu, const double *io, long size) {
  for (long i = 0; i < size; i++) {
    double t = kt[i], r = kr[i];
    b->pair[0][i] = isinf(t) ? 1.0 : t / (1.0 + t); b->pair[1][i] = 1.0 / (1.0 + t);
    b->pair[2][i] = isinf(r) ? 1.0 : r / (1.0 + r); b->pair[3][i] = 1.0 / (1.0 + r);
    b->pair[4][i] = mu[i] / (1.0 + mu[i]); b->pair[5][i] = 1.0 / (1.0 + mu[i]);
    b->pair[6][i] = io[i] / (1.0 + io[i]); b->pair[7][i] = 1.0 / (1.0 + io[i]);
    b->zeros[i] = (t == 0.0) + (r == 0.0);
  }
  for (long i = 0; i < size; i++) {
    double a[12];
    coefficients(b->pair[0][i], b->pair[1][i], b->pair[2][i], b->pair[3][i], b->pair[4][i], b->pair[5][i],
                 b->pair[6][i], b->pair[7][i], a);
    for (int j = 0; j < 12; j++) b->k[j][i] = a[j];
  }
  for (long i = 0; i < size; i++) {
    double a[TERMS];
    power_series(b->k[0][i], b->k[1][i], b->k[2][i], b->k[3][i], b->k[4][i], b->k[5][i], b->k[6][i], b->k[7][i],
                 b->k[8][i], b->k[9][i], b->k[10][i], b->k[11][i], a);
    for (int j = 0; j < TERMS; j++) b->h[j][i] = a[j];
  }
  for (long i = 0; i < size; i++)
    for (long n = 0; n < b->zeros[i]; n++) {
      for (int j = 0; j < TERMS - 1; j++) b->h[j][i] = b->h[j + 1][i];
      b->h[TERMS - 1][i] = 0.0;
    }
}

static inline int64_t count(const block *b, long i, double lam, double z, const double *f, double *value) {
  double c[5];
  chain(b->pair[0][i], b->pair[1][i], b->pair[2][i], b->pair[3][i], b->pair[4][i], b->pair[5][i], b->pair[6][i],
        b->pair[7][i], z, f[0], f[1], f[2], f[3], f[4], c);
  double turns = lam * (1 / PI);
  int64_t n = (int64_t)turns, change = turns - n < 0.5 ? -1 : 1;
  n += (c[0] > 0) == !(n & 1) ? 0 : change;
  n -= (c[1] > 0) == !(n & 1) ? 0 : 1;
  n += (c[2] > 0) == !(n & 1) ? 0 : 1;
  n += (c[3] > 0) == !(n & 1) ? 0 : 1;
  n += (c[4] > 0) == !(n & 1) ? 0 : 1;
  *value = c[4];
  return n;
}

static long counted(int64_t (*counts)[LANES], row *values, const block *b, const point *at, long points, long modes,
                    long size) {
  for (long i = 0; i < size; i++) { counts[0][i] = b->zeros[i]; values[0][i] = NAN; }
  for (long p = 1; p < points; p++) {
    const double lam = at[p].lam, z = at[p].z, f[5] = {at[p].basis[0], at[p].basis[1], at[p].basis[2], at[p].basis[3],
                                                       at[p].basis[4]};
    int64_t fewest = modes;
    for (long i = 0; i < size; i++) {
      double value;
      int64_t n = count(b, i, lam, z, f, &value);
      counts[p][i] = n; values[p][i] = value;
      fewest = n < fewest ? n : fewest;
    }
    if (fewest >= modes) return p;
  }
  return points - 1;
}

static double second(const block *b, long i, double low, double high) {
  double square = b->h[1][i] * b->h[1][i], d = square - 4.0 * b->h[0][i] * b->h[2][i];
  double z = (fabs(b->h[1][i]) + sqrt(d > 0.0 ? d : 0.0)) / (2.0 * fabs(b->h[2][i]));
  return d > 0.1 * square && low < z && z < high ? z : 0.0;
}

static double by_phase(long i, long k, const point *at, const row *values, long last) {
  double left = values[k - 1][i], here = values[k][i], amplitude = left * left + here * here, growth = 1.0;
  if (k > 2) {
    growth = amplitude / (values[k - 2][i] * values[k - 2][i] + left * left);
    growth *= k < last ? (here * here + values[k + 1][i] * values[k + 1][i]) / amplitude : growth;
    growth = sqrt(sqrt(growth));
  }
  double turn = atan2(fabs(left) * growth, fabs(here)) * (2 / PI);
  double lam = at[k - 1].lam + turn * (at[k].lam - at[k - 1].lam);
  return (lam * lam) * (lam * lam);
}

static void start(double *z, long number, const int64_t *right, int64_t (*counts)[LANES], const row *values,
                  const point *at, const block *b, long last, long size) {
  for (long i = 0; i < size; i++) {
    long k = right[i];
    if (number < b->zeros[i]) { z[i] = 0.0; continue; }
    int64_t below = counts[k - 1][i], above = counts[k][i];
    double low = at[k - 1].z, high = at[k].z, guess;
    if (number == b->zeros[i]) {
      z[i] = smaller(fabs(b->h[0][i]) / sqrt(b->h[1][i] * b->h[1][i] - 2.0 * b->h[0][i] * b->h[2][i]), high);
    } else if (number == b->zeros[i] + 1 && k < 3 && above == number + 1 && (guess = second(b, i, low, high)) > 0.0) {
      z[i] = guess;
    } else if (below == number && above == number + 1 && k > 1) {
      z[i] = by_phase(i, k, at, values, last);
    } else {
      while (below < number && number + 1 < above) {
        double middle = low > 0 ? sqrt(low * high) : high / 16, lam = sqrt(sqrt(middle)), f[5], value;
        scaled_basis(lam, middle, f);
        int64_t n = count(b, i, lam, middle, f, &value);
        if (n <= number) { low = middle; below = n; } else { high = middle; above = n; }
      }
      z[i] = below == number ? low : high;
    }
  }
}

static inline double step(double z, const block *b, long i, double *value) {
  double lam = sqrt(sqrt(z)), f[5], d[3];
  basis(lam, exp_(-lam), f);
  derivatives(b->k[0][i], b->k[1][i], b->k[2][i], b->k[3][i], b->k[4][i], b->k[5][i], b->k[6][i], b->k[7][i],
              b->k[8][i], b->k[9][i], b->k[10][i], b->k[11][i], z, f[0], f[1], f[2], f[3], f[4], d);
  double n0 = b->h[TERMS - 1][i], n1 = 0.0, n2 = 0.0;
  for (int j = TERMS - 2; j >= 0; j--) { n2 = n2 * z + n1; n1 = n1 * z + n0; n0 = n0 * z + b->h[j][i]; }
  double first = z < NEAR ? n1 : d[1], curve = z < NEAR ? 2.0 * n2 : d[2], factor = z < NEAR ? 1.0 : z;
  *value = z < NEAR ? n0 : d[0];
  double found = factor * fabs(*value) / sqrt(first * first - *value * curve);
  return *value == 0.0 ? 0.0 : found;
}

static inline int there(double now, double previous, double z) {
  double ratio = now / previous;
  return now * ratio * ratio * ratio <= 1e-15 * z || now <= 1e-13 * z;
}

static int climb(double *restrict z, long number, const block *restrict b, long size, long *evaluations) {
  row previous, ahead;
  long active[LANES], left = 0;
  int even = !(number & 1);
  for (int turn = 0; turn < 2; turn++)
    for (long i = 0; i < size; i++) {
      double value, s = step(z[i], b, i, &value);
      previous[i] = ahead[i]; ahead[i] = s;
      z[i] += (value > 0) == even ? s : -s;
    }
  for (long i = 0; i < size; i++) {
    if (number < b->zeros[i]) z[i] = 0.0;
    else if (!there(ahead[i], previous[i], z[i])) { active[left++] = i; previous[i] = ahead[i]; }
  }
  *evaluations += 2 * size;
  for (int turn = 0; turn < 80; turn++) {
    if (!left) return 1;
    *evaluations += left;
    row fresh;
    for (long n = 0; n < left; n++) {
      long i = active[n];
      double value;
      ahead[n] = step(z[i], b, i, &value);
      fresh[n] = z[i] + ((value > 0) == even ? ahead[n] : -ahead[n]);
    }
    long still = 0;
    for (long n = 0; n < left; n++) {
      long i = active[n];
      z[i] = fresh[n];
      int done = there(ahead[n], previous[i], z[i]);
      previous[i] = ahead[n];
      if (!done) active[still++] = i;
    }
    left = still;
  }
  return 0;
}

int frequency_parameters(double *out, long lanes, long modes, const double *kt, const double *kr, const double *mu,
                         const double *io, long *evaluations) {
  long points = 2 * modes + 42;
  int reached = 1;
  point *at = malloc(points * sizeof *at);
  int64_t (*counts)[LANES] = malloc(points * sizeof *counts), right[LANES];
  row *values = malloc(points * sizeof *values), z;
  block *b = calloc(1, sizeof *b);
  for (long p = 0; p < points; p++) {
    double lam = p ? PI * ((p - 1) / 2.0 + 0.0625) : 0.0;
    at[p].lam = lam; at[p].z = lam * lam * lam * lam;
    scaled_basis(lam, at[p].z, at[p].basis);
  }
  for (long first = 0; first < lanes; first += LANES) {
    long size = lanes - first < LANES ? lanes - first : LANES;
    prepare(b, kt + first, kr + first, mu + first, io + first, size);
    long last = counted(counts, values, b, at, points, modes, size);
    for (long number = 0; number < modes; number++) {
      long low = 2 * number - 8 > 0 ? 2 * number - 8 : 0, high = 2 * number + 8 < last ? 2 * number + 8 : last;
      for (long i = 0; i < size; i++) right[i] = low;
      for (long p = low; p <= high; p++)
        for (long i = 0; i < size; i++) right[i] += counts[p][i] <= number;
      start(z, number, right, counts, values, at, b, last, size);
      reached &= climb(z, number, b, size, evaluations);
      for (long i = 0; i < size; i++) out[(first + i) * modes + number] = sqrt(sqrt(z[i]));
    }
  }
  free(at); free(counts); free(values); free(b);
  return reached;
}
