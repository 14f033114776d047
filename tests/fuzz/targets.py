"""What is fed with bytes by strangers: for each door some good bytes to begin with, and what to do with any bytes.

A door may say no (`InputError`, `RefusalError`, `DecodeError`) and nothing else: no other exception, no second of work.
The one exception: where the length of a text is damaged in an HDF5 file, its library sets aside up to 4 GB and reads.
"""

import atexit
import contextlib
import dataclasses
import gc
import io
import pathlib
import shutil
import tempfile
import warnings
from collections.abc import Callable

import h5py
import numpy as np
import pyuff
from nptdms import ChannelObject, RootObject, TdmsWriter
from scipy.io import savemat, wavfile

from services.config import load_case, shipped
from services.drives import load_drive
from services.errors import InputError, RefusalError
from services.guard import Guard
from services.importers.load import frequency_responses, load_recording
from services.messages import TOPICS, OperatorRequest, SampleBlock, TurretCommand
from services.recording_file import read_messages, read_metadata
from services.recording_writer import McapRecorder
from services.wire import DecodeError, decode, encode
from tests.services.guard_kit import LIMITS
from tests.services.test_wire import example

KINDS = list(TOPICS.values())
NO = (InputError, RefusalError, DecodeError)
RATE = 2000.0
X = np.random.default_rng(1).standard_normal((40, 2)).round(3)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Door:
    """Where bytes come in: good ones, what takes them, its share of all inputs, the longest work on one (s)."""

    seeds: tuple[bytes, ...]
    open: Callable[[bytes], None]
    share: float
    slowest_s: float = 1.0


def message(data: bytes) -> None:
    """Decode as the kind that the first byte names; what is read can be sent, and commands reach a guard."""
    if not data:
        return
    found = decode(KINDS[data[0] % len(KINDS)], data[1:])
    encode(found)
    if isinstance(found, TurretCommand | OperatorRequest):
        guard = Guard(LIMITS, run="run", controller="controller", operator="operator", token=str)
        guard.command(found, 90) if isinstance(found, TurretCommand) else guard.request(found)
        guard.notices()


_MEMORY = pathlib.Path("/dev/shm")
_FOLDER = pathlib.Path(tempfile.mkdtemp(prefix="antiphase-fuzz-", dir=_MEMORY if _MEMORY.is_dir() else None))
atexit.register(shutil.rmtree, _FOLDER, ignore_errors=True)


def _from_file(suffix: str, read: Callable[[pathlib.Path], object]) -> Callable[[bytes], None]:
    def use(data: bytes) -> None:
        path = _FOLDER / f"fuzzed{suffix}"
        path.write_bytes(data)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read(path)

    return use


def _made(suffix: str, write: Callable[[pathlib.Path], object]) -> bytes:
    path = _FOLDER / f"seed{suffix}"
    path.unlink(missing_ok=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write(path)
        gc.collect()  # pyuff leaves its file to be closed
    return path.read_bytes()


def _table(separator: str, comma: bool = False, head: str = "") -> bytes:
    time = np.arange(len(X)) / RATE
    rows = [separator.join(f"{value:.5f}" for value in (t, *row)) for t, row in zip(time, X, strict=True)]
    text = f"{head}time_s{separator}ax_g{separator}ay_g\n" + "\n".join(rows) + "\n"
    return (text.replace(".", ",") if comma else text).encode()


def _lvm() -> bytes:
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nMulti_Headings\tYes\n"
        "X_Columns\tOne\nTime_Pref\tAbsolute\nDate\t2020/01/02\nTime\t03:04:05.6\n***End_of_Header***\t\n\t\n"
        f"Channels\t2\t\nSamples\t{len(X)}\t{len(X)}\nY_Unit_Label\tg\tN\nX_Dimension\tTime\tTime\nX0\t0.0\t0.0\n"
        f"Delta_X\t{1 / RATE}\t{1 / RATE}\n***End_of_Header***\t\t\nX_Value\tacc\tforce\tComment\n"
    )
    rows = [f"{k / RATE:.6f}\t{a:.4f}\t{b:.4f}" for k, (a, b) in enumerate(X)]
    return (head + "\n".join(rows) + "\n").encode()


def _hdf5(path: pathlib.Path) -> None:
    with h5py.File(path, "w") as file:
        group = file.create_group("cut")
        group.attrs["sample_rate"] = RATE
        group["acc"] = X
        group["acc"].attrs["unit"] = "g"
        group["compound"] = np.zeros(4, dtype=[("a", "f8"), ("b", "i4")])
        group["names"] = ["ax", "ay"]


def _tdms(path: pathlib.Path) -> None:
    told = {"wf_increment": 1 / RATE, "unit_string": "g"}
    with TdmsWriter(str(path)) as file:
        for part in (slice(0, 20), slice(20, 40)):
            pair = [ChannelObject("cut", name, column[part], told) for name, column in zip("xy", X.T, strict=True)]
            file.write_segment([RootObject({"operator": "x"}), *pair])


def _uff(func_type: int, binary: int) -> Callable[[pathlib.Path], None]:
    def write(path: pathlib.Path) -> None:
        pyuff.UFF(str(path)).write_sets({
            "type": 58, "func_type": func_type, "rsp_node": 1, "rsp_dir": 3, "ref_node": 0, "ref_dir": 0,
            "data": X[:, 0] if func_type == 1 else X[:, 0] + 1j * X[:, 1], "x": np.arange(len(X)) / RATE, "id1": "x",
            "rsp_ent_name": "", "ref_ent_name": "", "ver_num": 0, "abscissa_spacing": 1, "abscissa_spec_data_type": 17,
            "ordinate_spec_data_type": 12, "load_case_id": 0, "orddenom_spec_data_type": 0,
            "z_axis_spec_data_type": 0, "binary": binary,
        }, "add")  # fmt: skip

    return write


def _mcap(path: pathlib.Path) -> None:
    with McapRecorder(path, {"run": "r", "config": "{}"}) as recorder:
        for kind in (SampleBlock, TurretCommand):
            recorder.record(example(kind), 1)


def _wav(dtype: str) -> bytes:
    file = io.BytesIO()
    wavfile.write(file, 2000, (X * 20).astype(dtype))
    return file.getvalue()


def _case(text: bytes) -> None:
    """Read as a case; a table that is only changed in part is laid over a shipped one."""
    path = _FOLDER / "fuzzed.toml"
    path.write_bytes(text)
    load_case(str(path))


def _mat(**options: object) -> bytes:
    return _made(".mat", lambda path: savemat(path, {"fs": RATE, "acc": X, "s": {"a": X[:, 0], "b": "g"}}
                                               if options.get("format") != "4" else {"fs": RATE, "acc": X}, **options))


def _read(path: pathlib.Path) -> None:
    load_recording(path)


def _all(path: pathlib.Path) -> None:
    for _ in read_messages(path):
        pass
    read_metadata(path)


def _mcap_both(path: pathlib.Path) -> None:
    with contextlib.suppress(*NO):
        _read(path)
    _all(path)


def doors() -> dict[str, Door]:
    """All doors by name; their seeds are made here."""
    whole = shipped()["thesis-652"].read_bytes()
    over = b'extends = "thesis-652"\n[limits]\nshift_deg = 5.5\non_loss = "return"\n[cutting]\ndepth_of_cut_mm = 0.2\n'
    drive = (pathlib.Path(str(shipped()["thesis-652"])).parent / "drives" / "emps.toml").read_bytes()
    made = {
        "message": (tuple(bytes([k]) + encode(example(kind)) for k, kind in enumerate(KINDS)), message, 0.91),
        "case": ((whole, over), _case, 0.01),
        "drive": ((drive,), _from_file(".toml", lambda path: load_drive(str(path))), 0.01),
        "csv": ((_table(","), _table(";", True), _table("\t", head="# fs = 2000\n")), _from_file(".csv", _read), 0.01),
        "lvm": ((_lvm(),), _from_file(".lvm", _read), 0.01),
        "wav": (tuple(map(_wav, ("int16", "uint8", "int32", "float32"))), _from_file(".wav", _read), 0.02),
        "mat": ((_mat(), _mat(format="4"), _mat(do_compression=True)), _from_file(".mat", _read), 0.01),
        "hdf5": ((_made(".h5", _hdf5),), _from_file(".h5", _read), 0.005),
        "tdms": ((_made(".tdms", _tdms),), _from_file(".tdms", _read), 0.005),
        "uff": (tuple(_made(".uff", _uff(*kind)) for kind in ((1, 0), (1, 1), (4, 0))),
                _from_file(".uff", lambda path: (frequency_responses(path), _read(path))), 0.005),
        "mcap": ((_made(".mcap", _mcap),), _from_file(".mcap", _mcap_both), 0.005),
    }  # fmt: skip
    slow = {"hdf5": 10.0}
    return {
        name: Door(seeds=seeds, open=use, share=share, slowest_s=slow.get(name, 1.0))
        for name, (seeds, use, share) in made.items()
    }  # fmt: skip
