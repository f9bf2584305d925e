"""Spectra of kernels that are kept: the same answers to the bit, never a wrong one, and nobody is stopped."""

import contextlib
import doctest
import os
import re
import resource
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from commands import ENVIRONMENT
from numpy.testing import assert_array_equal

from hexcontact import DeckError, FlexibilityOperator, KernelFolderWarning, Lattice
from hexcontact.core import kernel_cache, memory
from hexcontact.core.contact import ElasticPair, NormalContact
from hexcontact.core.friction import FrictionalContact

PAIR = ElasticPair(2e-12, -0.4e-12, 0.9e-12)
SPACING = 2e-6
Damage = Callable[[Path], object]
FORCE = ("force", "force", "force", "displacement")


@pytest.fixture(autouse=True)
def as_before() -> Iterator[None]:
    """Start with an empty cache, and leave the settings as they are without an environment."""
    kernel_cache.configure(memory="256 MB", folder=False, folder_size="2 GB", folder_shared=False)
    kernel_cache.clear()
    yield
    kernel_cache.configure(memory="256 MB", folder=False, folder_size="2 GB", folder_shared=False)


def test_examples_are_right() -> None:
    assert doctest.testmod(kernel_cache) == (0, 3)


def window(n_row: int = 47, n_col: int = 52, spacing: float = SPACING) -> Lattice:
    return Lattice(spacing, -(n_row // 2), -(n_col // 2), n_row, n_col)


def normal(lattice: Lattice | None = None, pair: ElasticPair = PAIR, share: float = 0.1) -> np.ndarray:
    """Return pressure and gap of a contact that is small in its window: a part of it has operators, too."""
    lattice = lattice or window()
    gap = (lattice.x**2 + lattice.y**2) / (400 * lattice.spacing)
    contact = NormalContact(lattice, pair, gap)
    solution = contact.solve(approach=share * lattice.spacing)
    assert solution.converged
    return np.stack([solution.pressure, solution.gap])


def frictional(lattice: Lattice | None = None, pair: ElasticPair = PAIR) -> np.ndarray:
    """Return tractions after a normal and a tangential step."""
    lattice = lattice or window()
    gap = (lattice.x**2 + lattice.y**2) / (400 * lattice.spacing)
    contact = FrictionalContact(lattice, pair, gap, friction_coefficient=0.3)
    load = 0.4 * lattice.spacing**2 / pair.lambda_1
    state = contact.virgin()
    for shear in (0.0, 0.1):
        state = contact.advance(state, FORCE, (load, shear * load, 0.0, 0.0))
        assert state.converged
    return np.stack([state.pressure, state.traction_x, state.traction_y])


SOLVERS = {"normal": normal, "frictional": frictional}
solvers = pytest.mark.parametrize("solve", SOLVERS.values(), ids=SOLVERS)


def since(before: kernel_cache.Statistics) -> kernel_cache.Statistics:
    """Return what was found, read and made since some statistics were taken."""
    now = kernel_cache.statistics()
    return kernel_cache.Statistics(now.memory, *(b - a for a, b in zip(before[1:], now[1:], strict=True)))


# --- the same bits ------------------------------------------------------------------------------------------


@solvers
def test_answers_are_the_same_however_spectra_are_come_by(
    solve: Callable[[], np.ndarray], tmp_path: Path
) -> None:
    kernel_cache.configure(memory=0)
    without = solve()
    assert kernel_cache.statistics().memory == 0
    kernel_cache.configure(memory="50 MB")
    start = kernel_cache.statistics()
    assert_array_equal(solve(), without)
    made = since(start).made
    # on the window, on a coarse lattice, and on the part around the contact
    assert made == (5 if solve is normal else 9)
    start = kernel_cache.statistics()
    assert_array_equal(solve(), without)
    assert since(start)[1:] == (made, 0, 0)
    # through a folder, without the memory
    kernel_cache.configure(memory=0, folder=tmp_path)
    start = kernel_cache.statistics()
    assert_array_equal(solve(), without)
    assert since(start)[1:] == (0, 0, made)
    assert len(list(tmp_path.iterdir())) == made
    start = kernel_cache.statistics()
    assert_array_equal(solve(), without)
    assert since(start)[1:] == (0, made, 0)


def test_spectra_serve_other_spacings_and_moduli_and_nothing_else() -> None:
    one = normal()
    start = kernel_cache.statistics()
    # an exact power of two: then the answer is the same to the bit, but for its unit
    stiffer = normal(pair=ElasticPair(PAIR.lambda_1 / 4, PAIR.lambda_2 / 4, PAIR.lambda_5 / 4))
    assert_array_equal(stiffer, one * np.array([4.0, 1.0])[:, None, None])
    larger = normal(window(spacing=3.7 * SPACING))
    assert_array_equal(larger[0] > 0, one[0] > 0)
    np.testing.assert_allclose(larger[0], one[0], rtol=0, atol=1e-6 * one[0].max())
    assert since(start).made == 0
    normal(window(n_col=51))
    assert since(start).made > 0

    both = frictional()
    start = kernel_cache.statistics()
    coarser = frictional(window(spacing=1.1 * SPACING))
    assert since(start).made == 0
    kernel_cache.configure(memory=0)
    assert_array_equal(normal(window(spacing=3.7 * SPACING)), larger)
    assert_array_equal(frictional(window(spacing=1.1 * SPACING)), coarser)
    kernel_cache.configure(memory="256 MB")
    for pair in (
        ElasticPair(PAIR.lambda_1, PAIR.lambda_2 / 2, PAIR.lambda_5),
        ElasticPair(PAIR.lambda_1, PAIR.lambda_2, PAIR.lambda_5 / 2),
    ):
        start = kernel_cache.statistics()
        cached = frictional(pair=pair)
        assert since(start).made > 0
        assert np.abs(cached - both).max() > 1e-3 * both.max()
        kernel_cache.configure(memory=0)
        assert_array_equal(frictional(pair=pair), cached)
        kernel_cache.configure(memory="256 MB")


def test_rounding_of_the_spacing_is_no_other_lattice() -> None:
    start = kernel_cache.statistics()
    for spacing in np.geomspace(1e-9, 1.0, 50):
        FlexibilityOperator(window(5, 6, spacing), PAIR)
    assert since(start)[1:] == (49, 0, 1)


def test_threads_share_spectra() -> None:
    without = [solve() for solve in SOLVERS.values()]
    kernel_cache.configure(memory="6 MB")  # so small that spectra come and go
    solve = [*SOLVERS.values()] * 3
    with ThreadPoolExecutor(max_workers=4) as pool:
        for number, answer in enumerate(pool.map(lambda call: call(), solve)):
            assert_array_equal(answer, without[number % 2])


# --- memory -------------------------------------------------------------------------------------------------


def operator(n_row: int) -> FlexibilityOperator:
    return FlexibilityOperator(window(n_row, 20), PAIR)


def test_least_recently_used_spectra_go_first() -> None:
    size = []
    for n_row in (21, 22, 23):
        operator(n_row)
        size.append(kernel_cache.statistics().memory)
    kernel_cache.configure(memory=size[-1])
    start = kernel_cache.statistics()
    operator(21)
    operator(24)  # takes the place of 22
    operator(21)
    operator(23)
    assert since(start)[1:] == (3, 0, 1)
    assert since(start).memory <= size[-1]
    operator(22)
    assert since(start).made == 2


def test_spectra_in_use_outlive_the_cache() -> None:
    flexibility = operator(30)
    pressure = np.ones(flexibility.lattice.shape)
    before = flexibility.apply(pressure)[0]
    kernel_cache.clear()
    assert kernel_cache.statistics().memory == 0
    operator(31)
    assert_array_equal(flexibility.apply(pressure)[0], before)


def test_cache_makes_room_for_a_case_that_needs_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    operator(40)
    first = kernel_cache.statistics().memory
    operator(41)
    held = kernel_cache.statistics().memory
    monkeypatch.setattr(memory, "available", lambda: 10_000_000 - kernel_cache.statistics().memory)
    memory.require(10_000_000 - held + 1, "a case", "take less")
    assert kernel_cache.statistics().memory == held - first
    memory.require(1000, "a case", "take less")
    operator(40)
    operator(41)
    assert kernel_cache.statistics().memory == held
    memory.require(10_000_000, "a case", "take less")
    assert kernel_cache.statistics().memory == 0


# --- the folder ---------------------------------------------------------------------------------------------


def quietly(lattice: Lattice | None = None) -> np.ndarray:
    """Solve, and fail if there is a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return normal(lattice)


def flipped(place: int) -> Damage:
    def flip(path: Path) -> None:
        content = bytearray(path.read_bytes())
        content[place] ^= 4
        path.write_bytes(content)

    return flip


def swap_pages(path: Path) -> None:
    """Exchange two pages, as a file system does that mixes blocks up."""
    content = path.read_bytes()
    head, one, two, rest = content[:4096], content[4096:8192], content[8192:12288], content[12288:]
    path.write_bytes(head + two + one + rest)


DAMAGES: dict[str, Damage] = {
    "empty": lambda path: path.write_bytes(b""),
    "short": lambda path: path.write_bytes(path.read_bytes()[:-8]),
    "long": lambda path: path.write_bytes(path.read_bytes() + b"12345678"),
    "head only": lambda path: path.write_bytes(path.read_bytes()[:100]),
    "text": lambda path: path.write_text("a letter\n" * 1000),
    "first value": flipped(400 + 6),
    "last value": flipped(-1),
    "shape": flipped(368),
    "key": flipped(296),
    "maker": flipped(60),
    "layout": flipped(24),
    "bytes of a value": flipped(360),
    "hash": flipped(392),
    "swapped pages": swap_pages,
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_damaged_file_is_made_anew_with_one_warning(damage: Damage, tmp_path: Path) -> None:
    kernel_cache.configure(memory=0, folder=tmp_path)
    before = quietly()
    sound = {path: path.read_bytes() for path in tmp_path.iterdir()}
    victim = max(sound, key=lambda path: path.stat().st_size)
    damage(victim)
    with pytest.warns(KernelFolderWarning) as told:
        assert_array_equal(normal(), before)
    assert [re.sub(r"\S*/", "", str(w.message)) for w in told] == [
        f"{victim.name} is damaged, or was made by something else: the kernels are computed again"
    ]
    start = kernel_cache.statistics()
    assert_array_equal(quietly(), before)
    assert since(start).made == 0
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == sound


def test_spectra_of_another_window_are_not_taken(tmp_path: Path) -> None:
    kernel_cache.configure(memory=0, folder=tmp_path)
    windows = window(47, 52), window(47, 51)  # so alike that only the head knows
    before = [quietly(lattice) for lattice in windows]
    one, other = (next(tmp_path.glob(f"pressure-{shape}-*")) for shape in ("52x47", "51x47"))
    contents = one.read_bytes(), other.read_bytes()
    assert len(contents[0]) == len(contents[1])
    one.write_bytes(contents[1])
    other.write_bytes(contents[0])
    for lattice, answer in zip(windows, before, strict=True):
        with pytest.warns(KernelFolderWarning, match="is damaged, or was made by something else"):
            assert_array_equal(normal(lattice), answer)


def test_file_that_is_no_file_is_passed_over(tmp_path: Path) -> None:
    kernel_cache.configure(memory=0, folder=tmp_path)
    before = quietly()
    for path in tmp_path.iterdir():
        path.unlink()
        os.mkfifo(path)  # to open it would wait for somebody who writes
    with pytest.warns(KernelFolderWarning, match="cannot be read: the kernels are computed again"):
        assert_array_equal(normal(), before)
    assert_array_equal(quietly(), before)


def test_file_that_comes_and_goes_is_no_reason_to_warn(tmp_path: Path) -> None:
    kernel_cache.configure(memory=0, folder=tmp_path)
    operator(4)
    (path,) = tmp_path.iterdir()
    kernel_cache.flat.use_kernel_folder(os.fsencode(tmp_path) + b"/", kernel_cache._maker(), "0", 0, False)
    code = """
import os, sys
path, running = sys.argv[1:]
while os.path.exists(running):
    os.rename(path, path + ".away")
    os.rename(path + ".away", path)
"""
    running = tmp_path / "running"
    running.touch()
    start = kernel_cache.statistics()
    process = subprocess.Popen([sys.executable, "-c", code, str(path), str(running)])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            while since(start).made < 500:
                operator(4)
    finally:
        running.unlink()
        assert process.wait() == 0
    assert since(start).read > 0


# --- files of other users -----------------------------------------------------------------------------------

Change = Callable[[Path], object]
root_alone = pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
OPEN = "can be written by other users (chmod go-w)", "other users may write to it (chmod go-w, or"
CHANGES = [  # with the faults of a file and of a folder
    pytest.param(lambda path: path.chmod(path.stat().st_mode | 0o020), *OPEN, id="group may write"),
    pytest.param(lambda path: path.chmod(path.stat().st_mode | 0o002), *OPEN, id="all may write"),
    pytest.param(
        lambda path: os.chown(path, 54321, -1),
        "belongs to another user",
        "it belongs to another user",
        id="another owner",
        marks=root_alone,
    ),
]


@pytest.mark.parametrize(("change", "fault", "_"), CHANGES)
def test_file_of_another_user_is_not_believed(change: Change, fault: str, _: str, tmp_path: Path) -> None:
    kernel_cache.configure(memory=0, folder=tmp_path)
    before = quietly()
    victim = max(tmp_path.iterdir(), key=lambda path: path.stat().st_size)
    change(victim)
    kernel_cache.configure(folder_shared=True)
    start = kernel_cache.statistics()
    assert_array_equal(quietly(), before)
    assert since(start).made == 0
    kernel_cache.configure(folder_shared=False)
    with pytest.warns(KernelFolderWarning) as said:
        assert_array_equal(normal(), before)
    assert [str(w.message) for w in said] == [f"{victim} {fault}: the kernels are computed again"]
    start = kernel_cache.statistics()
    assert_array_equal(quietly(), before)
    assert since(start).made == 0


@pytest.mark.parametrize(("change", "_", "fault"), CHANGES)
def test_folder_of_another_user_is_not_used_unless_it_is_shared(
    change: Change, _: str, fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kernel_cache.configure(memory=0, folder=tmp_path)
    quietly()
    files = set(tmp_path.iterdir())
    change(tmp_path)
    with pytest.warns(KernelFolderWarning, match=f"no kernels are kept in .*: {re.escape(fault)}"):
        kernel_cache.configure(folder=tmp_path)
    start = kernel_cache.statistics()
    quietly(window(40, 41))
    assert since(start).read == 0
    assert set(tmp_path.iterdir()) == files
    monkeypatch.setattr(kernel_cache, "_settings", kernel_cache._Settings())
    monkeypatch.setenv(kernel_cache.FOLDER, str(tmp_path))
    monkeypatch.setenv(kernel_cache.MEMORY, "0")
    monkeypatch.setenv(kernel_cache.SHARED, "yes")
    start = kernel_cache.statistics()
    quietly()
    assert since(start).made == 0


def test_folder_and_files_are_made_so_that_no_other_user_may_write(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        kernel_cache.configure(memory=0, folder=tmp_path / "kernels")
        quietly()
    finally:
        os.umask(before)
    modes = {path.stat().st_mode & 0o022 for path in tmp_path.rglob("*")}
    assert modes == {0}


def test_shared_says_yes_or_no(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel_cache, "_settings", kernel_cache._Settings())
    monkeypatch.setenv(kernel_cache.SHARED, "perhaps")
    with pytest.raises(DeckError, match="HEXCONTACT_KERNEL_FOLDER_SHARED = 'perhaps': expected yes or no"):
        operator(20)


@pytest.mark.parametrize("name", ["ends with a blank ", "Müller", "two\nlines"])
def test_folder_may_have_any_name(tmp_path: Path, name: str) -> None:
    folder = tmp_path / name
    kernel_cache.configure(memory=0, folder=folder)
    normal()
    assert list(folder.iterdir())
    assert list(tmp_path.iterdir()) == [folder]


def test_vanished_folder_is_told_of_once(tmp_path: Path) -> None:
    folder = tmp_path / "kernels of Müller, 5 µm"
    before = normal()
    kernel_cache.configure(memory=0, folder=folder)
    folder.rmdir()
    with pytest.warns(KernelFolderWarning, match="Müller, 5 µm/.* cannot be written: no more") as told:
        assert_array_equal(normal(), before)
    assert len(told) == 1
    assert_array_equal(quietly(), before)


@contextlib.contextmanager
def disk_of(size: int) -> Iterator[None]:
    """Let no file become larger."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_file_that_fails_at_its_last_byte_is_not_kept(tmp_path: Path) -> None:
    kernel_cache.configure(memory=0, folder=tmp_path)
    # so small that it is written when it is closed
    with disk_of(1000), pytest.warns(KernelFolderWarning, match="cannot be written"):
        FlexibilityOperator(window(2, 2), PAIR)
    assert list(tmp_path.iterdir()) == []


def test_full_disk_is_told_of_once_and_leaves_nothing_behind(tmp_path: Path) -> None:
    before = normal()
    kernel_cache.configure(memory=0, folder=tmp_path)
    with disk_of(30_000), pytest.warns(KernelFolderWarning, match="cannot be written") as told:
        answer = normal()
    assert len(told) == 1
    assert_array_equal(answer, before)
    assert all(path.suffix == ".kernels" and path.stat().st_size < 30_000 for path in tmp_path.iterdir())
    assert_array_equal(quietly(), before)


def test_folder_that_cannot_be_made_is_told_of(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.warns(KernelFolderWarning, match="no kernels are kept in .*file"):
        kernel_cache.configure(folder=tmp_path / "file" / "kernels")
    quietly()


def test_oldest_files_go_when_the_folder_is_too_large(tmp_path: Path) -> None:
    old = "pressure-{0}x{0}-0123456789ABCDEF.kernels"
    for age in range(8):
        path = tmp_path / old.format(age)
        path.write_bytes(b"x" * 1000)
        os.utime(path, (1e9 - age, 1e9 - age))
    killed, running = (tmp_path / f"{old.format(9)}.{word}-1.part" for word in ("01d", "2e3"))
    others = [tmp_path / name for name in ("notes.txt", "my.kernels", "a.kernels.old.part")]
    for path in (killed, *others):
        path.write_bytes(b"x" * 5000)
        os.utime(path, (1e9, 1e9))
    running.write_bytes(b"x")
    kernel_cache.configure(folder=tmp_path, folder_size=8100)
    assert len(list(tmp_path.glob("*F.kernels"))) == 8
    kernel_cache.configure(folder_size=4000)
    assert {path.name for path in tmp_path.iterdir()} == {
        running.name,
        *(path.name for path in others),
        *(old.format(age) for age in range(2)),
    }
    quietly()  # no room for the larger ones: they are not kept, without a word
    assert sum(path.stat().st_size for path in tmp_path.glob("*x*.kernels")) <= 4000


def test_many_processes_may_fill_a_folder_at_once(tmp_path: Path) -> None:
    code = f"""
import sys; sys.path[:0] = [{str(Path(__file__).parent)!r}]
import test_kernel_cache as t
print(t.quietly().tobytes().hex())
"""
    env = ENVIRONMENT | {kernel_cache.FOLDER: str(tmp_path)}
    run = [subprocess.Popen([sys.executable, "-c", code], env=env, stdout=subprocess.PIPE) for _ in range(3)]
    answers = {process.communicate()[0] for process in run}
    assert [process.returncode for process in run] == [0, 0, 0]
    assert answers == {f"{normal().tobytes().hex()}\n".encode()}
    kernel_cache.clear()
    kernel_cache.configure(folder=tmp_path)
    start = kernel_cache.statistics()
    quietly()
    assert since(start).made == 0
    assert {path.suffix for path in tmp_path.iterdir()} == {".kernels"}


def test_packages_of_others_do_not_change_who_made_a_file() -> None:
    code = "{}from hexcontact import kernel_cache; print(kernel_cache._maker())"
    makers = {
        subprocess.run([sys.executable, "-c", code.format(more)], capture_output=True, check=True).stdout
        for more in ("", "import scipy.linalg, scipy.special, matplotlib.pyplot; ")
    }
    assert makers == {f"{kernel_cache._maker()}\n".encode()}


# --- settings -----------------------------------------------------------------------------------------------


def test_environment_is_read_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(kernel_cache, "_settings", kernel_cache._Settings())
    monkeypatch.setenv(kernel_cache.MEMORY, "0")
    monkeypatch.setenv(kernel_cache.FOLDER, str(tmp_path / "new" / "kernels"))
    monkeypatch.setenv(kernel_cache.FOLDER_SIZE, "1 MiB")
    operator(20)
    assert kernel_cache.statistics().memory == 0
    assert len(list((tmp_path / "new" / "kernels").iterdir())) == 1
    monkeypatch.setenv(kernel_cache.MEMORY, "1 GB")
    operator(20)
    assert kernel_cache.statistics().memory == 0


@pytest.mark.parametrize("text", ["much", "-1", "1 km", "1e30", "nan", "5 mB"])
def test_what_is_no_number_of_bytes_is_refused(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    with pytest.raises(DeckError, match=f"memory = '{text}': expected a number of bytes such as 512 MB"):
        kernel_cache.configure(memory=text)
    monkeypatch.setattr(kernel_cache, "_settings", kernel_cache._Settings())
    monkeypatch.setenv(kernel_cache.MEMORY, text)
    with pytest.raises(DeckError, match=f"HEXCONTACT_KERNEL_MEMORY = '{text}'"):
        operator(20)


@pytest.mark.parametrize(
    ("value", "number"), [("0", 0), (1e6, 10**6), ("1.5 kB", 1500), ("2 MiB", 2**21), ("3GB", 3 * 10**9)]
)
def test_numbers_of_bytes(value: float | str, number: int) -> None:
    assert kernel_cache._bytes(value, "") == number


def test_growth_is_limited_to_what_is_spare() -> None:
    """As much as fits beside what is there stays; less than nothing spare makes the cache smaller."""
    normal()
    before = kernel_cache.statistics().memory
    assert before > 0
    kernel_cache.limit_growth(10**9)
    normal(window(31, 33))
    grown = kernel_cache.statistics().memory
    assert grown > before
    kernel_cache.limit_growth(0)
    normal(window(35, 37))
    assert 0 < kernel_cache.statistics().memory <= grown
    kernel_cache.limit_growth(-(10**9))
    assert kernel_cache.statistics().memory == 0
    # the bound itself remains
    kernel_cache.limit_growth(10**9)
    normal()
    assert kernel_cache.statistics().memory == before
