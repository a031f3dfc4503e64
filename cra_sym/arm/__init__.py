"""The paper: one module a section, its numbered equations, the parameters and the public numeric functions."""
