"""What each measurement makes visible, from what the effects declare."""

from __future__ import annotations

from collections.abc import Iterator

from trueangle.effects import EFFECTS, Effect

__all__ = ["MEASUREMENTS", "causes_page", "measurement"]

#: What has to take several values for a cause to show, in the order of effort: key, heading
#: and what to do. The keys are those of `Effect.factor` and, where a column alone decides,
#: of `Effect.needs`.
MEASUREMENTS = {
    "none": ("Readings alone", "any readings of the indicated and the true angle"),
    "angle": ("Many angles", "one pass over the turn, at free angles or on planned mounts"),
    "time": ("Time within a run", "long runs, with time stamps where there are any"),
    "run": ("Several runs", "the same run again, several times"),
    "direction": ("Both directions", "every position approached from both sides, within each run"),
    "velocity": ("Two speeds", "time stamps, and speeds a factor of three apart"),
    "temperature": ("Two temperatures", "a column `temperature_C`, ten kelvin apart"),
    "torque": ("Two loads", "a column `torque_Nm`, loads of both signs"),
    "current": ("The motor's current", "a column `current_A`, varied apart from the load"),
    "coupled": (
        "The other joints of a robot",
        "columns of their angles (`coupled_NAME_deg`, or a robot file), each moved apart from this "
        "one",
    ),
    "mount": ("Two mounts", "the reference turned on its mount, and a column `mount_deg`"),
}


def measurement(effect: type[Effect]) -> str:
    """The key in `MEASUREMENTS` of what shows an effect."""
    needs = effect.needs if isinstance(effect.needs, tuple) else ()
    for column in needs:
        if column in MEASUREMENTS and column != "time":
            return column
    return effect.factor


def causes_page() -> str:
    """The measurements as headings, each with the causes that become visible by it."""
    lines: list[str] = []
    for key, (heading, what) in MEASUREMENTS.items():
        shown = [effect for effect in EFFECTS.values() if measurement(effect) == key]
        if shown:
            lines += [f"## {heading}", "", f"{what[0].upper()}{what[1:]}.", ""]
            for effect in shown:
                lines += [*_entry(effect), ""]
    return "\n".join(lines)


def _entry(effect: type[Effect]) -> Iterator[str]:
    """A cause as an item of a definition list."""
    yield f"`{effect.kind}`"
    yield f": {_sentence(effect.sentence)}"
    told = []
    if effect.measure:
        told.append(f"*To see it:* {_sentence(effect.measure)}")
    for other, how in effect.confused_with.items():
        told.append(f"*To distinguish it from* `{other.kind}`: {_sentence(how)}")
    if effect.not_at_run_time:
        told.append(f"*Not corrected:* {_sentence(effect.not_at_run_time)}")
    for text in told:
        yield ""
        yield f"  - {text}"


def _sentence(text: str) -> str:
    text = text.strip().rstrip(".")
    return f"{text}."
