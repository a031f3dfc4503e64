"""Symbolic engines: Hamilton's principle, separation, Ritz, multiple scales. They know beams and strings, never the arm."""
