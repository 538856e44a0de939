"""Drive and response brought onto one clock without interpolation."""

from collections.abc import Mapping

from fracjax._io._parts import Part
from fracjax._io._table import SIGNALS, Table, column_label
from fracjax._recording import InputError


def unequal(columns: Mapping[str, tuple[Table, int]]) -> InputError:
    """The refusal of columns that differ in length."""
    table = next(iter(columns.values()))[0]
    counts = " and ".join(
        f"{each.about(at).length} of {column_label(each.names, at)}"
        for each, at in columns.values()
    )
    return InputError.at(
        table.source, "as many samples in each column", counts, "choose columns of one length"
    )


def on_one_zero(parts: dict[str, Part]) -> dict[str, Part]:
    """The signals with their times counted from one zero, where the file says when each began."""
    if len(parts) < 2:
        return parts
    starts = {role: part.clock.start for role, part in parts.items()}
    if any(start is None for start in starts.values()):
        return parts
    zero = min(start for start in starts.values() if start is not None)
    return {
        role: part._replace(
            clock=part.clock._replace(
                times=part.clock.times + ((starts[role] or zero) - zero) / 1e9
            )
        )
        for role, part in parts.items()
    }


def aligned(
    parts: dict[str, Part], source: str
) -> tuple[dict[str, Part], dict[str, slice], list[str]]:
    """The signals over the time they have in common, where one grid of samples serves them all.

    Raises InputError where none does.
    """
    everything = {role: slice(0, len(part.values)) for role, part in parts.items()}
    if len(parts) < 2:
        return parts, everything, []
    (one, first), (two, second) = parts.items()
    a, b = first.clock, second.clock
    long = max(len(a.times), len(b.times))
    if abs(a.step - b.step) > 0.01 * a.step / long:
        rates = [f"the {SIGNALS[r]} at {1 / c.step:.6g} Hz" for r, c in ((one, a), (two, b))]
        sampling_rates = " and ".join(rates)
        fastest = max(1 / a.step, 1 / b.step)
        raise InputError.at(source, "one rate", sampling_rates, f"give --resample {fastest:.6g}Hz")
    shift = (b.times[0] - a.times[0]) / a.step
    if abs(shift) < 0.01 and len(a.times) == len(b.times):
        return parts, everything, []
    if abs(shift) < 0.01 and not (a.states_start and b.states_start):
        raise unequal({one: (first.table, first.column), two: (second.table, second.column)})
    whole = round(shift)
    if abs(shift - whole) > 0.01:
        raise InputError.at(
            source,
            "drive and response sampled at the same moments",
            f"the {SIGNALS[two]} {shift * a.step:.6g} s after the {SIGNALS[one]}",
            f"give --resample {1 / a.step:.6g}Hz",
        )
    begin = max(whole, 0)
    stop = min(len(a.times), whole + len(b.times))
    if stop - begin < 1:
        raise InputError.at(
            source,
            "drive and response at the same time",
            "times that do not overlap",
            "give files of the same run",
        )
    cuts = {one: slice(begin, stop), two: slice(begin - whole, stop - whole)}
    order = (two, one) if shift > 0 else (one, two)
    later, earlier = (SIGNALS[role] for role in order)
    note = (
        f"{source}: the {later} begins {abs(shift) * a.step:.6g} s after the {earlier}; both were "
        f"cut to the {stop - begin} samples they have in common."
    )
    aligned_parts = {
        role: part._replace(
            values=part.values[cuts[role]],
            clock=part.clock._replace(times=part.clock.times[cuts[role]]),
        )
        for role, part in parts.items()
    }
    return aligned_parts, cuts, [note]
