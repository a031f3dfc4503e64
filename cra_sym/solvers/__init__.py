"""Numbers only: complete spectra, responses, Floquet; never SymPy."""
