"""The table of printed statements and the table of comparisons hold what they claim, and say so when damaged."""

import pytest

from chaosgym.errors import DatasetError
from chaosgym.machines import MACHINES
from chaosgym.machines.parameters import with_settings
from thesis.scorecard.quantities import QUANTITIES
from thesis.statements import conditions, read_comparisons, read_statements
from thesis.statements.comparisons import parse_comparisons
from thesis.statements.statements import COLUMNS, parse_statements

HEADER = ",".join(COLUMNS)
ROW = "IBS-013,3.4,3.6,IBS,simulation,nature,19,19,Hz,,exact,"


def test_printed_numbers_are_those_of_the_thesis():
    """Natures at 19 and 30 Hz, 70 N at 29 Hz, 288.2 Hz at 284.0 mm, 75.6 Hz, 35 N at 270 rpm."""
    statements = read_statements()
    assert len(statements) == 231
    printed = {name: statements[name].low for name in ("IBS-013", "IBS-028", "IBS-034", "SSC-075", "SSC-051")}
    assert printed == {"IBS-013": 19.0, "IBS-028": 70.0, "IBS-034": 288.2, "SSC-075": 75.6, "SSC-051": 35.0}


@pytest.mark.parametrize(
    ("table", "complaint"),
    [
        (HEADER.replace("unit", "units") + "\n" + ROW, "columns"),
        (f"{HEADER}\n{ROW}\n{ROW}", "'IBS-013' is given twice"),
        (f"{HEADER}\n{ROW.replace('simulation', 'rumour')}", "kind = 'rumour'"),
        (f"{HEADER}\n{ROW.replace('19,19', '19,high')}", "line 2 .*value_high = 'high'"),
        (f"{HEADER}\n{ROW.replace('19,19', '19,')}", "allowed: both or none"),
        (f"{HEADER}\n{ROW.replace('IBS,sim', 'SSC,sim')}", "does not fit system"),
        (f"{HEADER}\nIBS-013,3.4", "has not 12 fields"),
    ],
)
def test_a_damaged_table_of_statements_is_refused(table, complaint):
    """The message names the line and the field."""
    with pytest.raises(DatasetError, match=complaint):
        parse_statements(table)


def test_every_simulated_statement_is_compared_or_left_out_with_a_reason():
    """None is forgotten, none is in both lists, and the conditions are fields of the machine that they name."""
    compared, out, unprinted = read_comparisons()
    known = {name: one.value for name, one in unprinted.items()}
    simulated = {name for name, one in read_statements().items() if {"simulation", "criterion"} & set(one.kinds)}
    assert {one.id for one in compared} | set(out) == simulated
    assert len({one.id for one in compared}) == len(compared)
    assert all(out.values())
    for one in compared:
        assert one.quantity in QUANTITIES
        for at in one.at:
            machine = with_settings(MACHINES[one.machine](), conditions(at, known))
            for axis in (one.along, one.across):
                if axis is not None:
                    with_settings(machine, {axis.field: axis.low})
                    with_settings(machine, {axis.field: axis.high})


ENTRY = '[IBS-013]\ngroup = "nature"\nquantity = "nature"\ntolerance = "nature"\nat = [{}]\n'
NATURE = '[tolerances.nature]\nreason = "equal or not"\n'


@pytest.mark.parametrize(
    ("table", "complaint"),
    [
        ("[IBS-013", "damaged"),
        (NATURE + ENTRY.replace("IBS-013", "IBS-999"), "IBS-999 is no statement"),
        (NATURE + ENTRY.replace('group = "nature"\n', ""), r"missing \['group'\]"),
        (NATURE + ENTRY.replace("[{}]", '[{ clearance = { unprinted = "x" } }]'), "unprinted = 'x' is not one of"),
        (ENTRY, "tolerance = 'nature' is not one of"),
        (NATURE.replace("equal or not", ""), "needs a reason"),
        (NATURE, "IBS-013 must be either compared or left out"),
        (NATURE + ENTRY + '[out]\nIBS-013 = "why"\n', "IBS-013 must be either compared or left out"),
    ],
)
def test_a_damaged_table_of_comparisons_is_refused(table, complaint):
    """The message names the statement and the field."""
    statements = parse_statements(f"{HEADER}\n{ROW}")
    with pytest.raises(DatasetError, match=complaint):
        parse_comparisons(table, statements)
