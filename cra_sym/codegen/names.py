"""Reserved words of the languages, so that a name is valid in all of them."""

from __future__ import annotations

__all__ = ["FORTRAN", "KEYWORDS", "RESERVED"]

_KEYWORDS = """
auto break case char const continue default do double else enum extern float for goto if inline int long register
restrict return short signed sizeof static struct switch typedef union unsigned void volatile while bool complex
imaginary alignas alignof atomic generic noreturn thread_local asm typeof class new delete template typename this
private public protected virtual operator namespace using throw try catch true false null nullptr
abstract arguments await boolean byte debugger eval export extends final finally function implements import in
instanceof interface let native of package super synchronized throws transient undefined var with yield async static
as crate dyn fn impl loop match mod move mut pub ref self trait type unsafe use where become box macro override priv
unsized gen union raw
and assert def del elif except from global is lambda none nonlocal not or pass raise print
begin baremodule end elseif module mutable primitive quote isa outer using
endfunction endif endfor endwhile unwind_protect otherwise persistent until methods properties events
"""
_ATTRIBUTES = """
allocatable allocate assign associate asynchronous backspace bind block call character close codimension common
concurrent contains contiguous cycle data deallocate deferred dimension elemental elsewhere entry enumerator
equivalence error exit external file forall format generic go implicit include inquire integer intent intrinsic kind
len logical namelist non_overridable nopass nullify only open optional parameter pointer precision procedure program
pure read real recursive result rewind save select sequence stop submodule subroutine sync target then to value wait
write
"""
_LIBRARY = """
abs acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1 fabs fdim floor fma
fmax fmin fmod frexp hypot ilogb ldexp lgamma tgamma gamma log log10 log1p log2 logb lrint lround modf nan nearbyint
nextafter pow remainder remquo rint round scalbn signbit sin sinh sqrt tan tanh trunc j0 j1 jn y0 y1 yn index time
signal clock exit abort free malloc main stdin stdout errno min max sum size shape real aint anint merge huge
tiny dp pi inf nan math e i j ans im isnan isfinite isinf ones zeros eye sign floor choose number list str tuple
dict set type id map filter range len repr input status evaluate characteristic model checks self_test
all any isreal inverse error real64 floor_real DomainError RangeError ArithmeticError Number NAN INFINITY HUGE_VAL
"""

KEYWORDS = frozenset(_KEYWORDS.split()) | {"result", "status"}
"""Names that no variable of a text in the restricted form may have."""

RESERVED = frozenset(f"{_KEYWORDS} {_ATTRIBUTES} {_LIBRARY} True False None NaN Inf Infinity Math Self".split())
"""Words no variable may be called."""

FORTRAN = frozenset(_LIBRARY.split()) - {"e"}
"""The same without regard to case: Fortran has no keywords, but functions that must not be hidden."""
