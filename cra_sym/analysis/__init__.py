"""What can be asked of any System: one module a question."""
