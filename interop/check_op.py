"""Foreign MainDevices take a SubDevice, a line and a tree to OP and exchange process data."""

from bench import FAR, FAR_B, HERE, NEAR, NEAR_B, Segment, Watch
from harness import CAT, CRAB, EBPF, LINE, LINESMAN, ONE, SOEM, TREE, check, found, ran, to_op, values_came_back
from plant import Plant

RING = Plant(HERE / "ring.toml")


@check
def soem_takes_one_subdevice_to_op(line):
    to_op(line, ONE, SOEM)


@check
def ethercrab_takes_one_subdevice_to_op(line):
    to_op(line, ONE, CRAB)


@check
def kickcat_takes_one_subdevice_to_op(line):
    to_op(line, ONE, CAT)


@check
def ebpfcat_takes_one_subdevice_to_op(line):
    to_op(line, ONE, EBPF)


# proves: ESC-05
@check
def soem_takes_the_line_to_op(line):
    assert to_op(line, LINE, SOEM) >= 40


@check
def ethercrab_takes_the_line_to_op(line):
    assert to_op(line, LINE, CRAB) >= 40


@check
def kickcat_takes_the_line_to_op(line):
    assert to_op(line, LINE, CAT) >= 40


@check
def ebpfcat_takes_the_line_to_op(line):
    assert to_op(line, LINE, EBPF) >= 40


@check
def soem_takes_the_tree_to_op(line):
    assert to_op(line, TREE, SOEM, cycles=800) >= 200


@check
def ethercrab_takes_the_tree_to_op(line):
    assert to_op(line, TREE, CRAB, cycles=800) >= 200


@check
def kickcat_takes_the_tree_to_op(line):
    assert to_op(line, TREE, CAT, cycles=800) >= 200


@check
def ebpfcat_takes_the_tree_to_op(line):
    assert to_op(line, TREE, EBPF, cycles=800) >= 200


@check
def soem_takes_the_tree_to_op_with_outputs_and_inputs_at_the_same_addresses(line):
    """Its overlapping map: what comes back where outputs went out are inputs."""

    def look(result):
        # Those with outputs and inputs.
        expected = [place for place, (_, kind, _) in enumerate(TREE.devices) if kind and kind.both_ways()]
        assert result["shared"] == expected, f"outputs and inputs share addresses at {result['shared']}, expected {expected}"

    assert to_op(line, TREE, SOEM, 800, "overlap", look=look) >= 200


@check
def inputs_held_from_outside_are_read(line):
    """What a test sets by the control socket is what the MainDevice reads."""
    with Segment(line, LINESMAN, LINE.file) as segment:
        held = {"I1.1": 1, "I1.2": 0, "I1.8": 1, "A1.1": 1234, "A1.2": -4321, "A1.3": 32767, "A1.4": -32768}
        for name, value in held.items():
            segment.ask(do="set", input=name, value=value)
        rounds = LINE.draw(2)
        result = SOEM.exchange(line, LINE, rounds)
        ran(line, result)
        for image in result["rounds"]:
            read = LINE.read(image)
            wrong = {name: (read[name], value) for name, value in held.items() if read[name] != value}
            assert not wrong, f"(read, expected) {wrong}"


@check
def one_foreign_maindevice_after_the_other(line):
    """What one leaves behind does not stop the next."""
    with Segment(line, LINESMAN, LINE.file) as segment:
        wires = segment.wires()
        for seed, client in enumerate((SOEM, CRAB, SOEM, CAT, CRAB)):
            rounds = LINE.draw(2, seed)
            result = client.exchange(line, LINE, rounds, cycles=100)
            found(result, LINE, client)
            ran(line, result)
            values_came_back(result, LINE, rounds, wires)


# proves: RED-01 partial: a foreign MainDevice in a ring that breaks while it runs
@check
def soem_keeps_a_ring_that_breaks(line):
    ring(line, SOEM)


@check
def kickcat_keeps_a_ring_that_breaks(line):
    ring(line, CAT)


def ring(line, client):
    """The break comes amid the exchanges of the first round."""
    with Segment(line, LINESMAN, RING.file, on=f"{FAR}+{FAR_B}") as segment:
        assert segment.present == len(RING), f"{segment.present} answered before the break"
        rounds, wires = RING.draw(4), segment.wires()

        def break_it():
            segment.ask(do="inject", fault={"kind": "link-open", "at": "I1.B-O1.A"})

        with Watch(segment, RING.shown(rounds[0]), break_it) as watch:
            result = client.exchange(line, RING, rounds, cycles=2000, on=f"{NEAR}+{NEAR_B}")
        assert watch.then is None, "the ring was not broken"
        # One frame may have been crossing the break.
        ran(line, result, RING, lost=1)
        values_came_back(result, RING, rounds, wires)
        status, out, _ = line.python(line.near, "probe.py", f"{NEAR}+{NEAR_B}")
        assert (status, out) == (0, "2\n"), f"the ring did not break: {out!r} answer on the first card"
