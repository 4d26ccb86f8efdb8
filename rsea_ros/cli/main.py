"""The command `rsea`: finds the verb, runs it, turns errors into one line."""

import argparse
import ast
import importlib
import logging
import os
import re
import sys
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import NoReturn, Protocol, cast

from rsea_ros import plugins
from rsea_ros.cli import _terminal
from rsea_ros.documents.wording import did_you_mean, printable
from rsea_ros.errors import ParameterError, RseaError
from rsea_ros.processes import Stopped, Stops
from rsea_ros.report.words import wrap

COMPILER = "rsea_ros.compiler"


@contextmanager
def compilation_announced() -> Iterator[None]:
    """In this block the compiler says on stderr that it compiles, if stderr is a terminal."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield
        return
    logger, line = logging.getLogger(COMPILER), logging.StreamHandler()
    line.setFormatter(logging.Formatter("rsea: %(message)s"))
    level = logger.level
    logger.addHandler(line)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(line)
        logger.setLevel(level)


SUCCESS, BAD_INPUT, INTERRUPTED, READER_GONE = 0, 2, 130, 141
_HELP, _VERSION = ("-h", "--help"), "--version"
FAULT = "this is a bug in rsea, please report it"
EXTRA = ("benchmark", "fleet", "watch")
"""Verbs of rsea_extras, to say so where it is not installed."""


class Verb(Protocol):
    """The interface of a verb: a module in this directory, or one that another package registers."""

    HELP: str
    EXAMPLE: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the verb's arguments, with units."""

    def run(self, args: argparse.Namespace) -> int:
        """Run the verb and return the exit status."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run `rsea VERB …` and return its exit status: 0, 1 for a finding of --fail-on, 2 for bad input."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    name = arguments[0] if arguments else "--help"
    prefix = "rsea"
    with _terminal.show_controls(), compilation_announced(), Stops() as stops:
        try:
            if module := "" if name.startswith("-") else module_of(name):
                prefix = f"rsea {name}"
            status = _call(name, module, arguments[1:])
            sys.stdout.flush()
            return status
        except BrokenPipeError:
            _silence_stdout()
            return READER_GONE
        except RseaError as error:
            return _fail(prefix, str(error))
        except OSError as error:
            place = f"{os.fsdecode(error.filename)}: " if error.filename else ""
            return _fail(prefix, f"{place}{error.strerror or error}")
        except KeyboardInterrupt as error:
            return _report_stop(prefix, error)
        except Exception as error:
            if stops.last is not None:  # the import of a library has turned the interrupt into another error
                return _report_stop(prefix, stops.last)
            return _fail(prefix, _fault(error))


def core_verbs() -> dict[str, str]:
    """Return the module of every verb beside this one by name (`import_.py` is `import`)."""
    stems = sorted(file.stem for file in Path(__file__).parent.glob("[!_]*.py") if file.stem != "main")
    return {stem.rstrip("_"): f"{__package__}.{stem}" for stem in stems}


def verbs() -> dict[str, str]:
    """Return the module of every verb by name, those that other packages register included."""
    return dict(sorted((plugins.installed(plugins.VERBS) | core_verbs()).items()))


def module_of(verb: str) -> str:
    """Return the module of a verb, empty for none. Raises ParameterError for one that is not installed."""
    module = core_verbs().get(verb) or plugins.registered(plugins.VERBS, verb)
    if not module and verb in EXTRA:
        raise plugins.not_installed(f"rsea {verb}")
    return module


def summary(module: str) -> str:
    """Return the HELP string of a verb, read from its file."""
    spec = find_spec(module)
    lines = Path(spec.origin).read_text(encoding="utf-8") if spec and spec.origin else ""
    stated = re.search(r'^HELP(?:: str)? = (\(?(?:\s*"(?:[^"\\]|\\.)*")+\s*\)?)$', lines, re.MULTILINE)
    return str(ast.literal_eval(stated[1])) if stated else ""


def _call(name: str, module: str, arguments: Sequence[str]) -> int:
    """Run a verb, or print the overview. Raises ParameterError for an unknown verb."""
    if name in _HELP:
        rows = [(f"  {name}", summary(module)) for name, module in verbs().items()]
        closing = "rsea VERB --help shows the arguments of a verb with units, and an example; rsea --version."
        closing = wrap(closing, _terminal.width())
        print("\n".join(["usage: rsea VERB …", "", _terminal.columns(rows), "", closing]))
        return SUCCESS
    if name == _VERSION:
        from rsea_ros.version import version

        print(f"rsea_ros {version()}")
        return SUCCESS
    if not module:
        near = did_you_mean(name, [*verbs(), *_HELP, _VERSION])
        meant = f", did you mean run {name}?" if name in plugins.node_modules() else near
        raise ParameterError(f"no verb {name!r}, expected one of: {', '.join(verbs())}{meant}")
    if effects := os.environ.get("RSEA_EFFECTS"):
        _fail(f"rsea {name}", f"RSEA_EFFECTS={effects}: code from there runs as part of this program")
    return _run(name, module, arguments)


def _run(name: str, module: str, arguments: Sequence[str]) -> int:
    """Import the verb, parse its arguments and run it.

    A verb that passes arguments to another program sets the default `pass_on`, which receives the unknown
    arguments.
    """
    verb = cast(Verb, importlib.import_module(module))
    parser = _Parser(
        prog=f"rsea {name}",
        description=verb.HELP,
        epilog=f"example:\n  {verb.EXAMPLE}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verb.add_arguments(parser)
    parser.words = arguments
    args, rest = parser.parse_known_args(attach_axis(arguments))
    if "pass_on" in args:
        args.pass_on = rest
    elif rest:
        parser.error(f"unrecognized arguments: {' '.join(rest)}{did_you_mean(rest[0], parser.options)}")
    return verb.run(args)


def attach_axis(arguments: Sequence[str]) -> list[str]:
    """Return the arguments with a reversed axis, `--axis -torque.z`, joined to one word.

    argparse would take the value for an option.
    """
    joined: list[str] = []
    for word in arguments:
        if joined and joined[-1] == "--axis" and word.startswith("-") and "." in word:
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


class _Parser(argparse.ArgumentParser):
    """A parser that reports an error in one line. words: the arguments, for the nearest option or action."""

    words: Sequence[str] = ()

    @property
    def options(self) -> list[str]:
        return [option for action in self._actions for option in action.option_strings]

    def error(self, message: str) -> NoReturn:
        near = "" if "did you mean" in message else self._nearest(message)
        sys.exit(_fail(self.prog, f"{message}{near} (see {self.prog} --help)"))

    def _nearest(self, message: str) -> str:
        """Return which action or option a wrong one may stand for; nothing if none is near."""
        if choice := re.search(r"invalid choice: '([^']*)' \(choose from (.*)\)", message):
            return did_you_mean(choice[1], re.findall(r"[\w-]+", choice[2]))
        given = [word.partition("=")[0] for word in self.words if word.startswith("--")]
        wrong = [word for word in given if not any(option.startswith(word) for option in self.options)]
        return did_you_mean(wrong[0], self.options) if wrong else ""


def _fault(error: Exception) -> str:
    """Return one line about an unexpected error; RSEA_TRACEBACK=1 shows the traceback."""
    if os.environ.get("RSEA_TRACEBACK"):
        traceback.print_exception(error)
    place = traceback.extract_tb(error.__traceback__)[-1]
    where = f"{Path(place.filename).name}:{place.lineno}"
    return f"{FAULT}: {type(error).__name__} in {where}: {error} (RSEA_TRACEBACK=1 shows more)"


def _report_stop(prefix: str, error: KeyboardInterrupt) -> int:
    note = f": {error.note}" if isinstance(error, Stopped) and error.note else ""
    if isinstance(error, Stopped) and error.status != INTERRUPTED:
        return _fail(prefix, f"stopped by {error}{note}", error.status)
    return _fail(prefix, f"interrupted{note}", INTERRUPTED)


def _fail(prefix: str, message: str, status: int = BAD_INPUT) -> int:
    with suppress(OSError):
        print(printable(f"{prefix}: {' '.join(message.split())}"), file=sys.stderr, flush=True)
    try:
        sys.stdout.flush()
    except OSError:
        _silence_stdout()
    return status


def _silence_stdout() -> None:
    """Redirect stdout to the null device, so that the last flush does not fail on the closed pipe."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
