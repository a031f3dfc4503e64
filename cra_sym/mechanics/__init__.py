"""Symbolic engines: Hamilton's principle, separation, Ritz, multiple scales; beams and strings, never the arm."""
