"""Second routes to the paper's results, which only proofs, tests and claims import."""
