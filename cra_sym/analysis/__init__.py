"""Analyses of any System, one per module."""
