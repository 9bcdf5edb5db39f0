"""What a fit's residual says about the fit: one word, plain sentences, and whether another estimator would suit it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

Verdict = Literal["sound", "coloured", "biased", "poor", "failed"]
LOOK_FURTHER = "`explain` looks further."
"""What to do about a force that the residual shows."""


@dataclass(frozen=True)
class Judgement:
    """What the residual says.

    - `verdict`: "sound": nothing but the sensors' noise is left. "coloured": neighbouring residuals are related, but not
      to the motion; if that is the sensor's doing the estimates stand, with standard errors made for it (above twice the
      noise the sentences say that this is open). "biased": what is left may be the sensors' noise alone, but that noise is in
      the regressors of a linear fit, too, and has moved parameters (`biased`). "poor": the model leaves much more than the
      noise, or what it leaves follows the motion, bears the mark of a force that is not in it, is slow where the sensor's
      noise is white, or is above twice the noise and comes in bursts, on one log more than on another, or too slowly to be
      tested; the estimates may carry a bias that no standard error shows. "failed": the
      model does not follow the logs; its parameters mean nothing.
    - `normalised_rms`: RMS of the residual in units of the noise, all channels; `by_channel`.
    - `white`: whether the residual passed the test of whiteness; None where the method has none to test.
    - `sentences`: what was found, most important first; none for a sound fit.
    - `better`: a sentence that names an estimator which suits this noise better, or what looks further; empty if there is none.
    - `biased`: parameters that noise in the regressors of a linear fit moves by more than half their standard error, with
      how many standard errors it is.
    - `follows`: channels whose residual follows the motion, with what it follows most of all.
    - `marked`: how likely chance is to leave the mark of a force that the residual bears, and by how many standard errors the
      force would move a parameter; (1, 0) without one.
    """

    verdict: Verdict
    normalised_rms: float
    by_channel: dict[str, float]
    white: bool | None
    sentences: tuple[str, ...] = ()
    better: str = ""
    biased: Mapping[str, float] = field(default_factory=dict)
    follows: Mapping[str, str] = field(default_factory=dict)
    marked: tuple[float, float] = (1.0, 0.0)

    @property
    def sentence(self) -> str:
        """All of it in one paragraph."""
        if self.verdict == "sound":
            text = f"Sound: the residual is {self.normalised_rms:.2f} times the noise{' and white' * bool(self.white)}."
        else:
            text = f"{self.verdict.capitalize()}: {' '.join(self.sentences)}"
        return f"{text} {self.better}".strip()

    @property
    def trustworthy(self) -> bool:
        """Whether an identified parameter may be shown without a qualifier."""
        return self.verdict in ("sound", "coloured")

    @property
    def doubt(self) -> str:
        """Of a poor or failed fit what `sentence` says, without the advice to explain it; else empty."""
        doubtful = self.verdict in ("poor", "failed")
        return self.sentence.removesuffix(LOOK_FURTHER).strip() if doubtful else ""

    def doubted(self, sentence: str) -> "Judgement":
        """The same of a fit whose residual turned out to hold what `sentence` says: a poor one."""
        return replace(self, verdict="poor", sentences=(sentence, *self.sentences), better=self.better or LOOK_FURTHER)

    def also(self, sentence: str) -> "Judgement":
        """The same with one more sentence."""
        return replace(self, sentences=(*self.sentences, sentence))

    def to_dict(self) -> dict[str, Any]:
        """As fit.json has it."""
        return {
            "verdict": self.verdict,
            "sentence": self.sentence,
            "normalised_rms": self.normalised_rms,
            "by_channel": dict(self.by_channel),
            "white": self.white,
            "better": self.better or None,
            "biased": dict(self.biased) or None,
        }
