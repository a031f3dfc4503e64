"""The paper: its numbered equations, one module a section, each with its derivation steps and its proof."""
