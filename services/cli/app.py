"""The `antiphase` command: one line per verb, one JSON object per answer, one exit code per kind of ending."""

from __future__ import annotations

import importlib
import json
import math
import pathlib
import sys
import tempfile
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

from services.errors import InputError, RefusalError

app = typer.Typer(
    name="antiphase",
    help="Chatter in parallel turning: simulated, found without a force sensor, stopped by moving turret 1.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
)
console = Console(stderr=True)

JsonFlag = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output and nothing else.")]
OutDir = Annotated[pathlib.Path | None, typer.Option("--out", help="Folder for what is written.")]
Seed = Annotated[int | None, typer.Option("--seed", help="Seed of every random number (default: the case's).", min=0)]
Sensitivity = Annotated[
    float | None,
    typer.Option("--sensitivity", help="Steps of 3 dB off every limit of the monitor, -3..3 (default: the case's)."),
]
Adapter = Annotated[
    str, typer.Option("--adapter", help="simulator, or linuxcnc: the turret's motion is that of a running LinuxCNC.")
]
LinuxcncDir = Annotated[
    pathlib.Path | None,
    typer.Option("--linuxcnc", help="Folder of `antiphase linuxcnc init` (default: one for as long as it runs)."),
]

INTERRUPTED = 1


def emit(payload: dict[str, Any], text: str, as_json: bool) -> None:
    """Print the answer: the object for programs, or the words for people."""
    print(json.dumps(_plain(payload), allow_nan=False) if as_json else text)


def require(field: str, value: float, rule: str, holds: bool) -> float:
    """Return a number from the command line, or say which rule it breaks."""
    if not math.isfinite(value) or not holds:
        raise InputError(field, value, rule)
    return value


def sensitive(steps: float | None) -> dict[str, Any]:
    """Return what `--sensitivity` changes in a case."""
    if steps is None:
        return {}
    return {"monitor.sensitivity": require("sensitivity", steps, "in -3..3", abs(steps) <= 3.0)}


def writable_folder(out: pathlib.Path | None) -> pathlib.Path | None:
    """Make the folder for what is written before the work begins, or say why that cannot be."""
    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=out):
                pass
        except OSError as error:
            raise InputError("out", str(out), f"a folder that can be written to ({error.strerror})") from error
    return out


def positive(field: str, value: float, unit: str) -> float:
    """Return a finite number above zero."""
    return require(field, value, f"a finite number above 0 {unit}", value > 0)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, pathlib.Path):
        return str(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _fail(error: dict[str, object], code: int, as_json: bool) -> int:
    if as_json:
        print(json.dumps({"error": _plain(error)}))
    else:
        console.print(f"antiphase: {error['message']}", style="bold red", markup=False, highlight=False)
    return code


def _usage(error: Exception, arguments: list[str]) -> dict[str, object]:
    """Turn the command-line library's complaint into the four keys of the contract."""
    message = error.format_message() if hasattr(error, "format_message") else str(error)  # pyright: ignore
    parameter = getattr(error, "param", None)
    names = getattr(parameter, "opts", None) or getattr(parameter, "secondary_opts", None) or []
    field = str(getattr(error, "option_name", None) or (names[0] if names else "") or _verb(message) or "command line")
    field = field.lstrip("-")
    value = next((arguments[k + 1] for k, a in enumerate(arguments[:-1]) if a.lstrip("-") == field), None)
    return {"field": field, "value": value, "rule": message.rstrip("."), "message": message}


def _verb(message: str) -> str:
    return "verb" if message.startswith("No such command") else ""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and leave with the exit code of the contract."""
    arguments = sys.argv[1:] if arguments is None else arguments
    sys.exit(_run(arguments, as_json="--json" in arguments))


def _run(arguments: list[str], as_json: bool) -> int:
    importlib.import_module("services.cli.verbs")  # registers the verbs

    try:
        code = app(args=arguments, standalone_mode=False, prog_name="antiphase")
    except InputError as error:
        return _fail(error.as_dict(), 2, as_json)
    except RefusalError as error:
        emit({**error.payload, "reason": error.reason}, f"antiphase cannot tell: {error.reason}", as_json)
        return 3
    except (KeyboardInterrupt, typer.Abort):
        return _fail({"field": "run", "value": None, "rule": "", "message": "interrupted"}, INTERRUPTED, as_json)
    except Exception as error:  # the one place that turns the unexpected into a sentence
        if hasattr(error, "format_message"):
            return _fail(_usage(error, arguments), 2, as_json)
        place = _origin(error)
        said = f"unexpected {type(error).__name__} in {place}: {error}"
        return _fail({"field": place, "value": None, "rule": "no unexpected error", "message": said}, 1, as_json)
    return code if isinstance(code, int) else 0


def _origin(error: Exception) -> str:
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return f"{pathlib.Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}" if trace else "unknown"
