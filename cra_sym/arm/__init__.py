"""The paper's arm: its parameters, its Lagrangian and its excitations by name."""
