"""What a functional mock-up unit says of itself: its variables, and modelDescription.xml."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

from ..model.model import HarmonicModel

__all__ = ["IDENTIFIER", "Variable", "build_description", "model_description", "variables_of"]

#: Of the library and of its functions.
IDENTIFIER = "trueangle_model"

_UNITS_3 = """\
  <UnitDefinitions>
    <Unit name="rad"><BaseUnit rad="1"/><DisplayUnit name="deg" factor="57.29577951308232"/></Unit>
    <Unit name="rad/s"><BaseUnit s="-1" rad="1"/></Unit>
    <Unit name="N.m"><BaseUnit kg="1" m="2" s="-2"/></Unit>
    <Unit name="K"><BaseUnit K="1"/><DisplayUnit name="degC" offset="-273.15"/></Unit>
    <Unit name="A"><BaseUnit A="1"/></Unit>
    <Unit name="s"><BaseUnit s="1"/></Unit>
  </UnitDefinitions>
"""


class Variable(NamedTuple):
    """One variable; its place in the list is its value reference."""

    name: str
    reference: int
    causality: str
    variability: str
    unit: str
    start: float
    description: str


def variables_of(model: HarmonicModel, sensor: bool, noise_std: float = 0.0) -> list[Variable]:
    """The time, inputs, parameters and the output last."""
    true = "true angle of the joint"
    said = "angle that its encoder indicates"
    first, last = (("true_angle", true), ("indicated", said))[:: 1 if sensor else -1]
    rows = [
        ("time", "independent", "continuous", "s", 0.0, "time"),
        (first[0], "input", "continuous", "rad", 0.0, first[1]),
        ("velocity", "input", "continuous", "rad/s", 0.0, "velocity of the joint"),
        ("torque", "input", "continuous", "N.m", 0.0, "torque at the output"),
        ("temperature", "input", "continuous", "K", 293.15, "temperature of the joint"),
    ]
    if "current" in model.signals:
        rows.append(("current", "input", "continuous", "A", 0.0, "current of the motor"))
    if sensor:
        rows += [
            (
                "noise_std",
                "parameter",
                "tunable",
                "rad",
                noise_std,
                "standard deviation of white noise",
            ),
            ("seed", "parameter", "fixed", "", 1.0, "of the noise"),
        ]
    rows.append((last[0], "output", "continuous", "rad", 0.0, last[1]))
    return [Variable(name, i, *rest) for i, (name, *rest) in enumerate(rows)]  # type: ignore[arg-type]


def model_description(
    variables: Sequence[Variable], fmi: str, sensor: bool, token: str, about: str, tool: str
) -> str:
    """modelDescription.xml of FMI 3.0 or 2.0."""
    name = f"trueangle {'sensor' if sensor else 'correction'}"
    can = 'canGetAndSetFMUState="true"'
    head = (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<fmiModelDescription fmiVersion="{fmi}.0" '
        f"modelName={quoteattr(name)} description={quoteattr(about)} "
        f"generationTool={quoteattr(tool)} "
    )
    if fmi == "3":
        return head + _third(variables, token, can)
    return head + _second(variables, token, can)


def build_description() -> str:
    """sources/buildDescription.xml of FMI 3.0."""
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<fmiBuildDescription fmiVersion="3.0">\n'
        f'  <BuildConfiguration modelIdentifier="{IDENTIFIER}">\n'
        '    <SourceFileSet language="C99"><SourceFile name="model.c"/></SourceFileSet>\n'
        '    <Library name="m" external="true"/>\n'
        "  </BuildConfiguration>\n</fmiBuildDescription>\n"
    )


def _third(variables: Sequence[Variable], token: str, can: str) -> str:
    rows = []
    for v in variables:
        start = "" if v.causality in ("independent", "output") else f' start="{v.start!r}"'
        unit = f' unit="{v.unit}"' if v.unit else ""
        rows.append(
            f'    <Float64 name="{v.name}" valueReference="{v.reference}" '
            f'causality="{v.causality}" variability="{v.variability}" '
            f'description="{v.description}"{unit}{start}/>\n'
        )
    output = variables[-1].reference
    more = f'{can} canSerializeFMUState="true"'
    return (
        f'instantiationToken="{token}" variableNamingConvention="flat">\n'
        f'  <ModelExchange modelIdentifier="{IDENTIFIER}" {more} '
        'needsCompletedIntegratorStep="true"/>\n'
        f'  <CoSimulation modelIdentifier="{IDENTIFIER}" {more} '
        'canHandleVariableCommunicationStepSize="true"/>\n'
        f"{_UNITS_3}  <ModelVariables>\n{''.join(rows)}  </ModelVariables>\n"
        f'  <ModelStructure>\n    <Output valueReference="{output}"/>\n'
        f'    <InitialUnknown valueReference="{output}"/>\n  </ModelStructure>\n'
        "</fmiModelDescription>\n"
    )


def _second(variables: Sequence[Variable], token: str, can: str) -> str:
    rows = []
    for v in variables[1:]:
        start = "" if v.causality == "output" else f' start="{v.start!r}"'
        unit = f' unit="{v.unit}"' if v.unit else ""
        rows.append(
            f'    <ScalarVariable name="{v.name}" valueReference="{v.reference}" '
            f'causality="{v.causality}" variability="{v.variability}" '
            f'description="{v.description}"><Real{unit}{start}/></ScalarVariable>\n'
        )
    more = f'{can.replace("State=", "state=")} canSerializeFMUstate="true"'
    sources = '<SourceFiles><File name="model.c"/></SourceFiles>'
    unknown = f'<Unknown index="{len(rows)}"/>'
    return (
        f'guid="{token}" variableNamingConvention="flat" numberOfEventIndicators="0">\n'
        f'  <ModelExchange modelIdentifier="{IDENTIFIER}" {more}>{sources}</ModelExchange>\n'
        f'  <CoSimulation modelIdentifier="{IDENTIFIER}" {more} '
        f'canHandleVariableCommunicationStepSize="true">{sources}</CoSimulation>\n'
        f"{_UNITS_3}  <ModelVariables>\n{''.join(rows)}  </ModelVariables>\n"
        f"  <ModelStructure>\n    <Outputs>{unknown}</Outputs>\n"
        f"    <InitialUnknowns>{unknown}</InitialUnknowns>\n  </ModelStructure>\n"
        "</fmiModelDescription>\n"
    )
