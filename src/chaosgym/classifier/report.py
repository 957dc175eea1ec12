"""How does a training report read? A table of methods with their intervals, for people."""

from collections.abc import Mapping
from typing import Any

NAME_WIDTH = 38


def report_table(report: Mapping[str, Any]) -> list[str]:
    """Lines of the comparison on held-out rows."""
    rows = report["rows"]
    lines = [f"{rows['held_out']} held-out and {rows['training']} training points, 95 % bootstrap intervals"]
    losses = ", ".join(f"{kind} {loss:.3f}" for kind, loss in report["log_loss"].items())
    lines += [
        "",
        f"parameters: one network, taught by {report['model']}; log loss on {rows['calibration']} other points: "
        f"{losses}",
    ]
    for name in ("response_type", "nature"):
        lines += ["", *_block(f"{name.replace('_', ' ')} from parameters", report["parameters"][name])]
        lines += _ceiling(name, report["ceiling"])
    refused = report["parameters"]["refused"]
    lines.append(f"  refused: {refused['outside']:.1%} of machines outside the range, {refused['inside']:.1%} inside")
    for name, scene in report.get("records", {}).items():
        target = f", target {scene['target']:.0%}" if scene["target"] else ""
        lines += ["", *_block(f"nature, {name}{target}", scene["nature"])]
        lines.append(_line("response type by classifier", scene["response_type"]))
    if "transfer" in report:
        losses = ", ".join(f"{whose} {loss:.3f}" for whose, loss in report["transfer"]["log_loss"].items())
        lines += ["", f"records: log loss on the calibrating machines when learned from {losses}"]
        for name, scene in report["transfer"]["scenes"].items():
            lines += [
                "",
                *_block(
                    f"nature, {report['transfer']['machine']} by this machine's records alone, {name}", scene["nature"]
                ),
            ]
    if "refused" in report:
        shares = ", ".join(f"{name} {share:.1%}" for name, share in report["refused"].items())
        lines += ["", f"records refused by fault: {shares}"]
    if "speed" in report:
        lines += ["", _speed(report["speed"])]
    if "learning_curve" in report:
        lines += ["", f"{'learning curve':{NAME_WIDTH}s}  type    nature"]
        lines += [
            f"  {point['rows']:6d} points of {point['machines']:4d} machines     "
            f"{point['response_type']['accuracy'][0]:6.3f}  {point['nature']['accuracy'][0]:6.3f}"
            for point in report["learning_curve"]
        ]
    return lines


def _ceiling(name: str, ceiling: Mapping[str, float]) -> list[str]:
    if name not in ceiling:
        return []
    if name == "nature":
        within = f"+-{ceiling['half_interval']:.3f}; label noise: the nature within 0.1 % in every parameter"
        return [f"  {'ceiling':{NAME_WIDTH}s} {ceiling[name]:.3f} {within}"]
    return [f"  {'two definitions of the type agree':{NAME_WIDTH}s} {ceiling[name]:.3f}"]


def _speed(speed: Mapping[str, Any]) -> str:
    text = (
        f"one machine {speed['query_us']:.0f} us, {speed['rows_per_second']:,.0f} rows a second on {speed['threads']} "
        f"threads; Two-Step Test {speed['two_step_us']:.0f} us, {speed['times_faster']:,.0f} times as long"
    )
    if "record_us" not in speed:
        return text
    return text + (
        f"; one record {speed['record_us']:.0f} us, {speed['cycles_saved']} cycles saved, "
        f"{speed['times_faster_by_record']:.1f} times faster with its simulation"
    )


def _block(title: str, methods: Mapping[str, Any]) -> list[str]:
    head = f"{title}\n  {'':{NAME_WIDTH}s} accuracy               balanced               ECE    sure 90 %"
    best = sorted(methods.items(), key=lambda item: -item[1]["accuracy"][0])
    return [*head.split("\n"), *(_line(name, scores) for name, scores in best)]


def _line(name: str, scores: Mapping[str, Any]) -> str:
    shown = [
        f"{value:.3f} [{low:.3f}, {high:.3f}]" for value, low, high in (scores["accuracy"], scores["balanced_accuracy"])
    ]
    rest = ""
    if "calibration_error" in scores:
        rest = f"   {scores['calibration_error']:.3f}  {scores['accuracy_on_most_confident']:.3f}"
    return f"  {name:{NAME_WIDTH}s} {shown[0]}   {shown[1]}{rest}"


def card_lines(card: Mapping[str, Any]) -> list[str]:
    """Model card as Markdown."""
    ranges = ", ".join(f"{name} {low:.4g} to {high:.4g}" for name, (low, high) in card["ranges"].items())
    machines = card["report"]["machines"]
    return [
        f"# Classifier of the {card['machine']}'s response type",
        "",
        "Use: type (I, II, III) and nature of a response from machine parameters, or from 8 to 64 measured peaks.",
        f"Data: {card['rows']['parameters']} labelled responses, {card['rows']['records']} recorded windows of "
        f"{' and '.join(card['records_of'])}; "
        f"{machines['training']} machines (or blocks) train, {machines['calibration']} calibrate, "
        f"{machines['held_out']} judge.",
        f"Range, SI: {ranges}.",
        f"Limits: {card['limits']}.",
        f"Made by chaosgym {card['version']}: `{card['command']}`.",
        "",
        "```",
        *report_table(card["report"]),
        "```",
    ]
