"""The paper's claims, each with a computed verdict: whether and where it holds, and what change would make it hold."""

from cra_sym.claims.family import ArmFamily, provenance_family
from cra_sym.claims.ledger import claim, claims
from cra_sym.claims.overviews import figure_claims, figure_family
from cra_sym.claims.setting import Setting
from cra_sym.claims.verdict import OUTCOMES, THEMES, EvidenceArray, Finding, Judgement, Verdict, judged

__all__ = [
    "OUTCOMES",
    "THEMES",
    "ArmFamily",
    "EvidenceArray",
    "Finding",
    "Judgement",
    "Setting",
    "Verdict",
    "claim",
    "claims",
    "figure_claims",
    "figure_family",
    "judged",
    "provenance_family",
]
