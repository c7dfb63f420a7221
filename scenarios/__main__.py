"""The command line, `til`.

What a user can mend is one line on standard error and exit status 2, Ctrl-C one and 130; a
traceback is a bug of ours.
"""

import sys
import warnings
from collections.abc import Sequence
from typing import Any

import click

from scenarios.cli import (
    car_commands,
    doctor,
    live_commands,
    log_commands,
    plan_command,
    study_commands,
    weigh_commands,
)
from scenarios.cli.options import Mistake
from scenarios.cli.output import show_warning


def main(args: Sequence[str] | None = None) -> int:
    """Runs a command; returns the exit status."""
    try:
        with warnings.catch_warnings():
            warnings.showwarning = show_warning
            status = program.main(args, prog_name="til", standalone_mode=False)
    except click.ClickException as error:
        click.echo("til: " + " ".join(_message(error).split()), err=True)
        return error.exit_code
    return status if isinstance(status, int) else 0


def _message(error: click.ClickException) -> str:
    """What is wrong and where to read what is allowed."""
    context = error.ctx if isinstance(error, click.UsageError) else None
    hint = f" (see {context.command_path} --help)" if context else ""
    return error.format_message() + hint


class Interrupted(click.ClickException):
    """Ctrl-C."""

    exit_code = 130  # 128 + SIGINT


class Program(click.Group):
    """The commands, with the errors a user is to see told apart from bugs."""

    def invoke(self, ctx: click.Context) -> Any:
        """Runs the command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise Interrupted("interrupted") from None
        except (click.ClickException, click.exceptions.Exit):
            raise
        except Exception as error:
            from twin.errors import TwinError  # not at the top: twin imports MuJoCo and numba

            if isinstance(error, TwinError):
                raise Mistake(str(error)) from error
            raise


@click.group(
    cls=Program,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(package_name=doctor.PROJECT, message="%(prog)s %(version)s")
@click.pass_context
def program(context: click.Context) -> None:
    """Drives a car and its digital twin, and estimates what nobody measures."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


for command in (
    *study_commands.COMMANDS,
    *car_commands.COMMANDS,
    *log_commands.COMMANDS,
    *live_commands.COMMANDS,
    *weigh_commands.COMMANDS,
    *plan_command.COMMANDS,
    doctor.doctor,
):
    program.add_command(command)

if __name__ == "__main__":
    sys.exit(main())
