"""Small files that would take much memory are refused by what they say of themselves."""

import io
import re
import tracemalloc
import zipfile

import numpy as np
import pytest
from digiclay.core.base.errors import DigiclayError, OutputError, ParameterError
from digiclay.core.control.displays import read_values
from digiclay.core.engine.simulation import begin
from digiclay.core.files.tables import LARGEST
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find, load, read_table
from digiclay.core.scene.toml_table import format_scene, resolve
from digiclay.core.session import snapshot
from digiclay.core.session.finished_run import read_run
from digiclay.core.session.memory_limit import measure_available_memory
from digiclay.core.session.take import Take, from_bytes, to_bytes
from digiclay.core.shapes.fitting import read as read_shape
from digiclay.core.shapes.heightmap import make_height_map
from digiclay.core.shapes.request import Shape

#: What refusing may take, bytes.
LITTLE = 4_000_000


def refused(work):
    """Return what is said where something is refused; it is one line, and took little memory."""
    tracemalloc.start()
    try:
        with pytest.raises(DigiclayError) as caught:
            work()
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert "\n" not in str(caught.value)
    assert most < LITTLE
    return str(caught.value)


BOMB = ".".join(20_000 * ["a"])


@pytest.mark.parametrize(
    "bomb",
    [f"{BOMB} = 1", f"[{BOMB}]", "x = { " + " . ".join(20_000 * ['"a"']) + " = 1 }",
     'x = """a\nb"""\n' + ".".join(20_000 * ["'a'"]) + " = 1"],
)  # fmt: skip
def test_a_key_of_20_000_names_is_refused_with_its_line(tmp_path, bomb):
    path = tmp_path / "bomb.toml"
    path.write_text(f"# fine so far\n{bomb}\n", encoding="utf-8")
    said = refused(lambda: load(path))
    line = 2 + bomb.count("\n")
    assert f"bomb.toml, line {line}: a key must have at most 16 names" in said
    setting = Setting("fluid.density", "{ " + BOMB + " = 1 }")
    assert "fluid.density must be a number" in refused(lambda: load(find("slow_press"), [setting]))


NAMES = "a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r.s.t"


@pytest.mark.parametrize(
    "harmless",
    [f'description = "{NAMES}"', f"description = '''\\n{NAMES}'''", f"# {NAMES}",
     "[shape]\nheights = '" + 5000 * "a" + "'", f'description = "\\"{NAMES}"', "\ufeffname = 'marked'"],
)  # fmt: skip
def test_what_stands_in_a_text_is_no_key_nor_is_a_byte_order_mark(tmp_path, harmless):
    (tmp_path / "my.toml").write_text(harmless, encoding="utf-8")
    assert read_table(tmp_path / "my.toml").keys() <= {"description", "name", "shape"}


@pytest.mark.parametrize("quote", ['"\\', "'''a", '"""\\"', '"""a', "'a"])
def test_a_text_without_an_end_is_not_gone_over_again_and_again(tmp_path, quote):
    # Quadratic, half a megabyte would take minutes: the whole run's limit of time would strike.
    (tmp_path / "my.toml").write_text(100_001 * quote, encoding="utf-8")
    assert refused(lambda: read_table(tmp_path / "my.toml"))


def test_a_scene_or_array_beyond_all_sizes_or_for_another_bed_is_not_read(tmp_path):
    with (tmp_path / "hole.toml").open("wb") as file:
        file.truncate(LARGEST + 1)  # takes no room on the disk
    assert "hole.toml must have at most 128 MB (got 128 MB)." in refused(
        lambda: load(tmp_path / "hole.toml")
    )
    many = np.broadcast_to(np.float32(0.0), (20_000, 20_000))
    with pytest.raises(
        ParameterError, match=r"at most 128 million heights .got x.npy: 20000 x 20000"
    ):
        make_height_map("x.npy", many)
    np.save(tmp_path / "large.npy", np.zeros((1000, 1000)))
    bed = make_grid(Layout(2, 2, 3e-3))
    path = str(tmp_path / "large.npy")
    assert "2 x 2 cells" in refused(lambda: read_values("shape", path, bed, 0.0, 1.0, "m"))


def history(folder, **arrays):
    """Leave what a run of four cells and ten periods leaves, with some arrays in place of its own."""
    scene = resolve(
        {"layout": {"rows": 2, "columns": 2}, "simulation": {"duration": 0.05}, "blister": SMALL}
    )
    (folder / "scene.toml").write_text(format_scene(scene), encoding="utf-8")
    own = {"time": np.arange(11) * 5e-3, "height": np.zeros((11, 4)), "force": np.zeros((11, 4))}
    np.savez_compressed(folder / "history.npz", **(own | arrays))
    return folder


SMALL = {"radius": 2e-3, "edge_radius": 2.5e-3, "flat_radius": 1e-3}


@pytest.mark.parametrize(
    "arrays, said",
    [
        ({"time": np.zeros(5_000_000)}, "the 11 rows of its scene's 10 control periods (got 5,000,000)"),
        ({"time": np.zeros(0)}, "(got 0)"),
        ({"height": np.zeros((11, 500_000))}, "the shape (11, 4) of its scene (got (11, 500000))"),
        ({"height": np.zeros((500_000, 4))}, "height must have the shape (11, 4)"),
        ({"height": np.zeros((11, 4), "V900")}, "height must hold numbers of at most 8 bytes"),
        ({"height": np.zeros((11, 4), "c16")}, "height must hold numbers of at most 8 bytes"),
    ],
)  # fmt: skip
def test_a_history_that_is_not_its_scenes_is_not_unpacked(tmp_path, arrays, said):
    folder = history(tmp_path, **arrays)
    assert (folder / "history.npz").stat().st_size < 200_000
    assert said in refused(lambda: read_run(folder, "height"))


@pytest.mark.parametrize("kind", ["f2", "f4", ">f8", "i1"])
def test_numbers_that_another_program_wrote_in_fewer_bytes_are_those_of_a_run(tmp_path, kind):
    folder = history(tmp_path, force=np.full((11, 4), 120, kind))
    force = read_run(folder, "force").history["force"]
    assert (force.dtype, force.min(), force.max()) == (np.float64, 120.0, 120.0)


@pytest.mark.parametrize(
    "name, kind, said", [("height", "<f4", "1.6e+04"), ("mode", "|i1", "2e+03")]
)
def test_a_history_that_does_not_fit_into_memory_is_not_unpacked(tmp_path, name, kind, said):
    # 20 million cells over 100 000 rows are what such a scene would leave: 16 TB of numbers, which
    # are read as those of 8 bytes, and 2 TB of modes.
    scene = resolve({"layout": {"rows": 4472, "columns": 4472}, "simulation": {"duration": 500.0}})
    (tmp_path / "scene.toml").write_text(format_scene(scene), encoding="utf-8")
    shape = (100_001, 4472 * 4472)
    with zipfile.ZipFile(tmp_path / "history.npz", "w") as archive:
        archive.writestr("time.npy", npy(np.zeros(shape[0])))
        archive.writestr(f"{name}.npy", head(shape, kind))
    # The directory of a zip can say anything; ours says what the head does.
    with zipfile.ZipFile(tmp_path / "history.npz", "a") as archive:
        size = shape[0] * shape[1] * np.dtype(kind).itemsize
        archive.getinfo(f"{name}.npy").file_size += size
        archive.comment = b"written again"
    message = refused(lambda: read_run(tmp_path, name))
    assert f"of free memory (got {said} GB of time, {name})" in message
    assert measure_available_memory() < 2e12


def npy(array):
    """Return an array as a file of numpy's."""
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def head(shape, kind="<f8"):
    """Return the head of a file of numpy's, without the numbers."""
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        file, {"shape": shape, "fortran_order": False, "descr": kind}
    )
    return file.getvalue()


@pytest.mark.parametrize(
    "old, new",
    [(b"(?s)(.{700}).*", rb"\1"), (b"(?s).*", b""), (b"'descr': '<f8'", b"'descr': '|O8'"),
     (b"NUMPY", b"NIMPY"),
     (rb"\(11, 4\)", b"(99, 4)"), (rb"\(11, 4\)", b"(-1, 4)"), (rb"\(11, 4\)", b"((((4))")],
)  # fmt: skip
def test_a_damaged_history_is_refused(tmp_path, old, new):
    folder = history(tmp_path)
    assert read_run(folder, "height", "force").history["force"].shape == (11, 4)
    with np.load(folder / "history.npz") as arrays:
        np.savez(folder / "plain.npz", **arrays)
    (folder / "history.npz").write_bytes(re.sub(old, new, (folder / "plain.npz").read_bytes()))
    assert "cannot be read as a run's history" in refused(lambda: read_run(folder, "height"))


def take():
    """Return a take of one period."""
    scene = resolve({"layout": {"rows": 2, "columns": 2}, "blister": SMALL})
    state = snapshot.dump(assemble(scene), begin(assemble(scene)))
    return to_bytes(Take(scene, state, np.tile([0.0, 0, 1, 1, 0, 0, 0], (2, 1, 1)), state))


@pytest.mark.parametrize(
    "save, name, value, said",
    [
        (
            np.savez_compressed,
            "poses",
            np.zeros((1_000_000, 1, 7)),
            r"unpack to at most its own .*got 56,",
        ),
        (
            np.savez,
            "scene",
            np.frombuffer(f"{BOMB} = 1".encode(), np.uint8),
            "must have at most 16 names",
        ),
        (np.savez, "version", np.arange(9_000), "cannot reshape array of size 9000"),
        (np.savez, "version", np.array("9" * 4_000), "its version must be at most"),
    ],
)
def test_a_take_that_unpacks_to_more_than_it_is_or_has_a_bomb_for_a_scene_is_refused(
    save, name, value, said
):
    data = io.BytesIO()
    with np.load(io.BytesIO(take())) as arrays:
        save(data, **{**arrays, name: value})
    assert len(data.getvalue()) < 100_000
    message = refused(lambda: from_bytes(data.getvalue()))
    assert re.search(said, message)
    assert len(message) <= 400


def test_a_take_of_bytes_cut_or_turned_anywhere_is_read_or_refused():
    whole, chance = take(), np.random.default_rng(5)
    for _ in range(300):
        data = bytearray(whole[: chance.integers(1, len(whole)) if chance.random() < 0.3 else None])
        for place in chance.integers(0, len(data), chance.integers(1, 4)):
            data[place] = chance.integers(0, 256)
        try:
            from_bytes(bytes(data))
        except OutputError as error:
            assert "\n" not in str(error)  # noqa: PT017


@pytest.mark.parametrize(
    "content",
    [head((10**9, 10**9)), head((2, 2)), npy(np.zeros((2, 2)))[:-1], b"\x93NUMPY\x01\0\x76\0" + 118 * b"(",
     b"\x93NUMPY\x01\0\x76\x1e" + 0x1E76 * b"-", b"\x93NUMPY\x09\0", b"PK\5\6" + bytes(18)],
)  # fmt: skip
def test_an_array_that_promises_more_than_there_is_is_refused(tmp_path, content):
    path = tmp_path / "heights.npy"
    path.write_bytes(content)
    assert "heights.npy" in refused(lambda: read_shape(Shape(file=str(path))))
    bed = make_grid(Layout(2, 2, 3e-3))
    assert "heights.npy" in refused(lambda: read_values("shape", str(path), bed, 0.0, 1.0, "m"))
