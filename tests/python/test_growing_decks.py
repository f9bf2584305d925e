"""Records that refer to the deck in earlier ones: sessions, whose deck grows by the loads of each step."""

import dataclasses
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fuzz.file_made import made_step, written
from numpy.testing import assert_array_equal

import hexcontact
from hexcontact import Case, DeckError, ResourceError, open_result
from hexcontact.deck.surfaces import Sphere
from hexcontact.result import journal, store
from hexcontact.result.journal import Header, Journal, journal_of
from hexcontact.result.layout import Metadata, assemble
from hexcontact.result.store import Store

STEEL = {"young_modulus": 210e9, "poisson_ratio": 0.3}


def pressed(**arguments: Any) -> Case:
    """Press a sphere on a flat, 3 spacings in the contact radius."""
    return Case(
        body_1={**STEEL, "surface": Sphere(radius=10e-3)},
        body_2=STEEL,
        nodes_in_radius=3,
        friction_coefficient=0.3,
        **{"normal_load": 10.0, **arguments},
    )


def loads_of(out: Path) -> list[tuple[float, float]]:
    """Return the loads along z and x that the deck of a journal leads to."""
    deck = Journal(journal_of(out)).metadata.deck
    return [(step.z.value, step.x.value) for step in Case.from_text(deck).load_steps]


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out.nc"


def test_records_of_a_session_do_not_grow(out: Path) -> None:
    with pressed().start(out) as session:
        session.advance(normal_load=10.0)
        for turn in range(12):
            session.advance(tangential_load_x=1.0 + turn % 2)
        sizes = [record.stat().st_size for record in Journal(journal_of(out)).records]
    assert max(sizes[2:]) - min(sizes[2:]) < 128  # digits of numbers; an entry has 33 characters
    assert len(Case.from_text(open_result(out).deck).load_steps) == 13


def test_the_deck_of_each_record_has_the_loads_so_far(out: Path, tmp_path: Path) -> None:
    """Wherever a session is killed, its deck leads to the finished steps, and the output is completed."""
    session = pressed().start(out)
    next(session)  # the deck of the case
    session.advance(normal_load=12.0, steps=2)
    session.advance(tangential_load_x=1.5, steps=3)  # entries before it have no tangential load
    with pytest.raises(DeckError, match="gross sliding"):
        session.advance(tangential_load_x=9.0)
    session.advance(normal_load=20.0)
    expected = [(10.0, 0.0), (11.0, 0.0), (12.0, 0.0), (12.0, 0.5), (12.0, 1.0), (12.0, 1.5), (20.0, 1.5)]
    records = Journal(journal_of(out)).records
    for count in range(1, len(records) + 1):
        killed = tmp_path / f"{count}.nc"
        shutil.copytree(journal_of(out), journal_of(killed))
        (journal_of(killed) / "lock").unlink()
        for later in records[count:]:
            (journal_of(killed) / later.name).unlink()
        assert np.array(loads_of(killed)) == pytest.approx(np.array(expected[:count]), rel=1e-12), count
        result = hexcontact.resume(killed)
        assert result.complete
        assert len(result) == count
        assert_array_equal(result.approach.values, [step.approach for step in session.steps[:count]])
    session.close()
    assert open_result(out).deck == result.deck


def test_a_failure_to_write_leaves_no_reference_to_it(out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with pressed().start(out) as session:
        for number, load in enumerate(({"normal_load": 10.0}, {"tangential_load_x": 0.5}), start=1):
            with monkeypatch.context() as patched:
                patched.setattr(journal, "write_record", full)
                with pytest.raises(ResourceError, match=f"step {number}"):
                    session.advance(**load)
            session.advance(**load)
        session.advance(tangential_load_x=0.6)
        assert loads_of(out) == [(10.0, 0.0), (10.0, 0.5), (10.0, 0.6)]
    assert len(open_result(out)) == 3


@pytest.mark.parametrize("by_hand", [True, False])
def test_a_failed_interim_output_leaves_the_step(
    out: Path, monkeypatch: pytest.MonkeyPatch, by_hand: bool
) -> None:
    """It is recorded, and the session goes on from it."""

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    def advance(session: Any, load: float) -> None:
        session.advance(normal_load=load) if by_hand else next(session)

    with pressed(steps=2).start(out) as session:
        with monkeypatch.context() as patched:
            patched.setattr(store, "PUBLISH_INTERVAL", 0.0)
            patched.setattr(store, "write", full)
            with pytest.raises(ResourceError, match="cannot write the output"):
                advance(session, 5.0)
        assert session.step.normal_load == pytest.approx(5.0)
        advance(session, 10.0)
    result = open_result(out)
    assert result.complete
    assert result.normal_load.values == pytest.approx([5.0, 10.0])
    assert Case.from_text(result.deck).load_steps[0].z.value == 5.0


@pytest.mark.parametrize("after", [0, 1])
def test_a_failure_to_write_the_last_step_of_several(
    out: Path, monkeypatch: pytest.MonkeyPatch, after: int
) -> None:
    write_record = journal.write_record

    def full(path: Path, *about: Any) -> None:
        if path.name.startswith("000004"):
            raise OSError(28, "No space left on device")
        write_record(path, *about)

    with pressed().start(out) as session:
        session.advance(normal_load=10.0)
        with monkeypatch.context() as patched:
            patched.setattr(journal, "write_record", full)
            with pytest.raises(ResourceError, match="step 4"):
                session.advance(tangential_load_x=1.5, steps=3, label="a long label of a segment")
        for _ in range(after):
            session.advance(tangential_load_x=1.2)
    expected = [(10.0, 0.0), (10.0, 0.5), (10.0, 1.0), (10.0, 1.2)][: 3 + after]
    loads = [(step.z.value, step.x.value) for step in Case.from_text(open_result(out).deck).load_steps]
    assert np.array(loads) == pytest.approx(np.array(expected), rel=1e-12)
    assert len(open_result(out)) == 3 + after


def test_a_header_after_a_resumption_has_its_metadata(out: Path) -> None:
    def changed(count: int) -> Any:
        return lambda step: step.number == count

    pressed(steps=5).run(out, on_step=changed(2))
    hexcontact.resume(out, overrides={"solver.tolerance": 1e-7}, on_step=changed(4))
    last = Journal(journal_of(out)).metadata
    assert last.parameters["tolerance"] == 1e-7
    assert "tolerance = 1e-07" in last.resumed[0]
    assert hexcontact.resume(out).complete


def test_a_journal_without_its_first_record_is_refused(out: Path) -> None:
    written(out, count=3, planned=4)
    (journal_of(out) / "000001.npz").unlink()
    for read in (open_result, Store.reopened):
        with pytest.raises(DeckError, match=r"lacks the record of step 1, 000001\.npz"):
            read(out)


def test_texts_of_a_long_session_are_read_a_few_times(out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """So that opening, too, takes time in proportion to the steps."""
    with Store(out, Metadata(planned_steps=1)) as file:
        file.describe(Header(Metadata(), 0))
        for index in range(20):
            control = {"segment": index // 2, "load": f"# {index}\n"}
            file.append(dataclasses.replace(made_step(index), control=control))
    reads: list[Path] = []
    original = journal._about

    def counted(archive: Any, path: Path) -> dict[str, Any]:
        reads.append(path)
        return original(archive, path)

    monkeypatch.setattr(journal, "_about", counted)
    assert open_result(out).deck == "".join(f"# {index}\n" for index in range(1, 20, 2))
    assert len(reads) <= 3 * 20 + 2


@pytest.mark.parametrize("every", [1, 2])
def test_steps_that_are_written_at_once_are_those_of_the_run(out: Path, every: int) -> None:
    metadata = Metadata(planned_steps=100, every=every)  # three blocks of up to 45 steps
    steps = [made_step(index) for index in range(100)]
    with Store(out, metadata) as file:
        for step in steps:
            file.append(step)
        file.finish()
    assert open_result(out).dataset.load().identical(assemble(metadata, steps))
