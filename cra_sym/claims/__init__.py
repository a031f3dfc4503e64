"""The paper's claims, each with a verdict the package computes: what holds, where, what does not, and what would."""

from cra_sym.claims.family import ArmFamily, provenance_family
from cra_sym.claims.ledger import claim, claims
from cra_sym.claims.overviews import figure_claims, figure_family
from cra_sym.claims.setting import Setting
from cra_sym.claims.verdict import OUTCOMES, THEMES, Finding, Judgement, Quantity, Verdict, judged

__all__ = [
    "OUTCOMES",
    "THEMES",
    "ArmFamily",
    "Finding",
    "Judgement",
    "Quantity",
    "Setting",
    "Verdict",
    "claim",
    "claims",
    "figure_claims",
    "figure_family",
    "judged",
    "provenance_family",
]
