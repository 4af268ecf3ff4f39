"""Linesman listens beside SOEM, KickCAT and ethercrab while a fault comes: it says what is so, or that it cannot tell.

What may be said in which case stands in beside_matrix.py: a cell that is wrong fails. A case that disagrees is played
again, as it may have been the host.
"""

from beside_matrix import agrees, document_outcomes, settled, told_counts
from harness import check


def beside(line, name):
    cells = settled([name])
    odd = [cell for cell in cells if not agrees(cell)]
    assert not odd, "; ".join(told(cell) for cell in odd)
    line.notes.append(told_counts(cells))
    written = document_outcomes(name)
    differing = [cell.key() for cell in cells if not written.get(cell.key())]
    assert not differing, f"docs/guide/beside.md tells otherwise of {differing}: `beside_matrix.py --write` writes it"


def told(cell):
    return f"{cell.client}, {cell.name}, {cell.when} is wrong ({cell.outcome}): {cell.said}; from the recording ({cell.outcome_recorded}): {cell.said_recorded}"


@check
def a_listener_beside_soem_says_nothing_wrong_of_any_fault(line):
    beside(line, "SOEM")


@check
def a_listener_beside_kickcat_says_nothing_wrong_of_any_fault(line):
    beside(line, "KickCAT")


@check
def a_listener_beside_ethercrab_says_nothing_wrong_of_any_fault(line):
    beside(line, "ethercrab")


for one in (
    a_listener_beside_soem_says_nothing_wrong_of_any_fault,
    a_listener_beside_kickcat_says_nothing_wrong_of_any_fault,
    a_listener_beside_ethercrab_says_nothing_wrong_of_any_fault,
):
    # Namespaces of its own: there is nothing on the cable of the check itself.
    one.spoils_frames = True
