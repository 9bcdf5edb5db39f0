"""What an interval that takes the noise for white is worth where a fit's residual is not."""

from ..result import Fit


def not_white(fit: Fit) -> str:
    """Why intervals for white noise are too narrow for this fit, in a sentence; empty where they may hold."""
    verdict = "" if fit.judgement is None else fit.judgement.verdict
    if verdict in ("poor", "failed"):
        return (
            f"The fit is {verdict}: its residual is not white noise of the sensors, as these intervals take it for, and they "
            "are too narrow."
        )
    if verdict == "coloured" or fit.standard_errors == "robust":
        return (
            "The fit's residual is coloured, and these intervals take it for white: they are too narrow. Its standard errors "
            "allow for the colour."
        )
    return ""
