"""What does a design report cost? Processor time of the template's, once everything is compiled."""

import tomllib
from dataclasses import replace

from benchmarks.performance.timing import processor_seconds
from chaosgym.design.brief import brief_from, template
from chaosgym.design.study import study
from chaosgym.plotting.design_report import design_report


def report_seconds(machine: str, search: bool) -> float:
    """Processor time [s] of the study of a machine's template and its page, with a search for changes or without.

    A study of the smallest series comes first, so that nothing is compiled within the time.
    """
    asked = brief_from(tomllib.loads(template(machine)))
    if not search:
        asked = replace(asked, changes={}, costs={})
    study(replace(asked, series_size=8, changes={}, costs={}), workers=1)
    return processor_seconds(lambda: design_report(study(asked, workers=1)))
