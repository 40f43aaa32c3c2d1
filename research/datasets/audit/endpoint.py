"""The other actor: a language model behind an endpoint proposes ranges; its answer is data."""

from __future__ import annotations

from dataclasses import dataclass

from ....fem.mpm.materials import MaterialClass
from ....fem.table import NU_CAP
from ....predictors.text.interpreter import ChatEndpoint
from .actor import AuditObject
from .proposal import Proposal, proposal_from

_PROMPT = """You propose what the parts of a 3D object may be made of, for a physics simulation.
Object: {object}. Its parts, and what they are called: {parts}.
For every part give the lowest and the highest plausible value, never one number:
"E" in Pa, "nu" (0 to {nu}), "rho" in kg/m^3. If the name states the material, give the range of
that material and "told": true; else all that such a part is usually made of. The low ends of all
parts together must move visibly more than the high ends under the same load.
"class" is one of: {classes}. "synonyms" are three short phrases that an image-text model may find
the part by. "constraints" are comparisons that hold for any values inside the ranges, such as
"pot.E >= soil.E": only part names, .E, .nu, .rho, numbers, + - * /, and, or, not, < <= > >=.
Answer with JSON alone: {{"parts": {{"PART": {{"E": [1e9, 2e9], "nu": [0.2, 0.3],
"rho": [900, 1100], "class": "jelly", "synonyms": ["..."], "told": false}}}}, "constraints": []}}"""


@dataclass(frozen=True)
class EndpointActor:
    """Asks a model for the ranges of an object (UniPixie supplement, A.1.1, in our own words)."""

    endpoint: ChatEndpoint

    def __call__(self, thing: AuditObject) -> Proposal:
        """Return the model's proposal; ``InputError`` where its answer is none, or out of bounds.

        Nothing of it is repaired or run.
        """
        prompt = _PROMPT.format(
            object=thing.name,
            parts=", ".join(f"{name} ({named.text})" for name, named in thing.parts.items()),
            nu=NU_CAP,
            classes=", ".join(kind.name.lower() for kind in MaterialClass),
        )
        return proposal_from(self.endpoint.ask(prompt), list(thing.parts))
