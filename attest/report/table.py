"""A run as text for a terminal."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from attest.errors import printable
from attest.report.info import shown, text_of_notes

KINDS = {
    "truth": "truth",
    "autopilot": "autopilot: an estimate from the same sensors, not independent, not truth",
    "smoother": "attest's own smoother over the same sensors, not truth",
}


def text_of_run(summary: Mapping[str, Any], written: Sequence[Path]) -> str:
    """Return the table of one run."""
    log, metrics = summary["log"], summary["metrics"]
    estimates = summary["estimates"]
    lines = [f"{shown(log['path'])}  {summary['observer']}", *_input(log, estimates)]
    if metrics is None:
        lines += ["  reference   none: not scored"]
    else:
        kind = KINDS[metrics["kind"]]
        lines += [f"  reference   {metrics['reference']} ({kind})", "", *_errors(metrics), ""]
        lines += _findings(metrics)
    lines += _state(summary)
    lines += _attestation(summary)
    lines += text_of_notes(summary)
    if written:
        names = " ".join(path.name for path in written)
        lines += ["", f"  written     {written[0].parent}/  {names}"]
    return "\n".join(map(printable, lines))


def _input(log: Mapping[str, Any], estimates: Mapping[str, Any]) -> list[str]:
    span = (estimates["last_ns"] - estimates["first_ns"]) * 1e-9
    rates: dict[str, list[str]] = {}
    for name, signal in log["signals"].items():
        rate = f" at {signal['rate_hz']:.1f} Hz" if signal["rate_hz"] else ""
        rates.setdefault(signal["source"] + rate, []).append(name)
    sources = [f"{', '.join(names)} of {source}" for source, names in rates.items()]
    first = f"  log         {log['format']}, {span:.1f} s, {log['vehicle'] or 'vehicle not named'}"
    return [first, *(f"  {'signals' if not i else '':12s}{s}" for i, s in enumerate(sources))]


def _errors(metrics: Mapping[str, Any]) -> list[str]:
    columns = ("total", "heading", "inclination")
    lines = ["  error" + " " * 7 + "".join(f"{name:>13s}" for name in columns)]
    for figure in ("rmse", "mean", "median", "p95", "max"):
        values = "".join(f"{metrics[name][figure]:12.2f}°" for name in columns)
        label = "RMSE" if figure == "rmse" else figure
        lines.append(f"  {label:12s}{values}")
    return lines


def _findings(metrics: Mapping[str, Any]) -> list[str]:
    """Return what is constant in the error, and how it settled."""
    flat, offset = metrics["without_heading_offset"]["rmse"], metrics["heading_offset_deg"]
    bound, settled = f"{metrics['settling_bound_deg']:g}°", metrics["settling_time_s"]
    late = metrics["time_offset_s"]
    if settled is None:
        settling = f"not below {bound} to the end"
    else:
        after = metrics["after_settling"]["rmse"]
        settling = f"{settled:.2f} s to stay below {bound}; RMSE after it {after:.2f}°"
    clocks = "the motion tells no offset" if late is None else f"reference late by {late:+.3f} s"
    lines = [
        f"  heading     constant offset {offset:+.2f}°; total RMSE without it {flat:.2f}°",
        f"  settling    {settling}",
        f"  clocks      {clocks}",
        f"  mounting    constant turn of {metrics['misalignment_deg']:.2f}° between the two bodies",
    ]
    if metrics["bias_true"] is not None:
        true = np.rad2deg(np.array(metrics["bias_true"]))
        words = (
            ""
            if metrics["bias_error"] is None
            else f"; estimate's error at the end {np.rad2deg(metrics['bias_error']):.3f} °/s"
        )
        lines.append(f"  true bias   {_vector(true)} °/s{words}")
    return lines


def _state(summary: Mapping[str, Any]) -> list[str]:
    bias = summary["estimates"]["gyro_bias"]
    words = "not estimated" if bias is None else f"{_vector(np.rad2deg(bias))} °/s at the end"
    consistency = summary["consistency"]
    used = ", ".join(f"{name} {share:.0%}" for name, share in consistency["used"].items())
    lines = [
        f"  gyro bias   {words}",
        f"  residual    |s_L| {consistency['s_norm_rms']:.3g} RMS, Wahba cost "
        f"{consistency['cost_mean']:.3g} mean; used {used or 'no vector'}",
    ]
    if (torque := summary["disturbance_torque"]) is not None:
        lines.append(f"  disturbance {_torque(torque)}")
    if "field_ut_median" in consistency:
        lines.append(f"  field       {_field(consistency)}")
    return lines


def _torque(torque: Mapping[str, Any]) -> str:
    """Return the disturbance torque at the end, and its error where truth is known."""
    rmse = torque["rmse_nm"]
    error = "" if rmse is None else f"; RMSE against the log's {rmse:.3g} N·m"
    return f"torque {_vector(torque['last_nm'])} N·m at the end{error}"


def _attestation(summary: Mapping[str, Any]) -> list[str]:
    """Return what theory promised, each with what was seen."""
    marks = {True: "yes", False: "NO", None: "open"}
    lines = ["", "  promised"] if summary["attestation"] else []
    for claim in summary["attestation"]:
        lines.append(f"  {marks[claim['holds']]:>9s}   {claim['statement']} [{claim['source']}]")
        lines.append(f"  {'':9s}   {claim['seen']}")
    return lines


def _field(consistency: Mapping[str, Any]) -> str:
    """Return the field's strength and dip, against the model where there is one."""
    median = consistency["field_ut_median"]
    text = "direction only" if median is None else f"{median:.1f} µT"
    if "field_ut_model" not in consistency:
        return text
    dip = consistency["dip_deg_median"]
    by_estimate = "" if dip is None else f", dip {dip:+.1f}°"
    model = f"{consistency['field_ut_model']:.1f} µT, dip {consistency['dip_deg_model']:+.1f}°"
    return f"{text}{by_estimate}; the model has {model}"


def _vector(v: Any) -> str:
    return ", ".join(f"{x:+.3f}" for x in v)
