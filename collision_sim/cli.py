# Copyright 2026 collision_sim developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
The command line: `collision_sim run | view | compile | report | advise | ...`.

A subcommand is a module with `add_arguments(parser)` and `run(arguments)`, which gives the exit
code; only the module of the one that was asked for is imported. Nothing that takes long is before
`main` listens for Ctrl-C.
"""

import sys

COMMANDS = {
    'run': ('collision_sim.studies.run', 'run a scene and say what happened'),
    'view': ('collision_sim.studies.view', 'run a scene in real time and show it in the browser'),
    'compile': ('collision_sim.studies.compile', 'compile what scenes need, before they run'),
    'report': ('collision_sim.studies.report', 'error against run time, on known or own scenes'),
    'advise': ('collision_sim.studies.advise', 'the method and dt for an error or a run time'),
    'stability': ('collision_sim.studies.stability', 'stiff and extreme cases'),
    'bench': ('collision_sim.studies.bench', 'run times, beside other toolkits'),
    'sweep': ('collision_sim.studies.sweep', 'many runs over a grid of values'),
}
EXAMPLES = """\
examples:
  collision_sim run demo --duration 5
  collision_sim view demo
  collision_sim compile demo
  collision_sim report --quick --out report
  collision_sim advise my.yaml --error 1e-3
  collision_sim stability
  collision_sim bench --quick
  collision_sim sweep demo --vary restitution=0.1:0.9:9 --repeat 10

`collision_sim COMMAND --help` says more about each."""
REFUSED, INTERRUPTED = 2, 130


def parse(words):
    """
    Read the command line.

    Parameters
    ----------
    words : list of str
        Without the name of the program.

    Returns
    -------
    argparse.Namespace
        Its `run` is the function to call with it.

    """
    import argparse
    from importlib import import_module
    parser = argparse.ArgumentParser(
        prog='collision_sim', epilog=EXAMPLES,
        description='Particles that collide with fixed and moving colliders.',
        formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(metavar='COMMAND', required=True)
    for name, (module, words_of_help) in COMMANDS.items():
        command = commands.add_parser(name, help=words_of_help, description=words_of_help,
                                      formatter_class=argparse.RawDescriptionHelpFormatter)
        if words[:1] == [name]:
            module = import_module(module)
            module.add_arguments(command)
            command.set_defaults(run=module.run)
    return parser.parse_args(words)


def _show(others, message, category, *place):
    """Print a warning about a scene in a line, as an error would be; leave others to `others`."""
    from collision_sim.checks import SceneWarning
    if issubclass(category, SceneWarning):
        print(f'collision_sim: warning: {message}', file=sys.stderr)
    else:
        others(message, category, *place)


def main(words=None):
    """
    Do what the command line asks for.

    Parameters
    ----------
    words : list of str, optional
        Without the name of the program; those of the process if absent.

    Returns
    -------
    code : int
        For the shell: 2 for a scene or a file that is not as it should be, 130 after Ctrl-C.

    """
    try:
        from collision_sim.core.interrupts import leave_what_is_aside
        from collision_sim.listener import Listener
        with Listener(last=words is None) as listener:
            code = _do(sys.argv[1:] if words is None else list(words), listener)
    except KeyboardInterrupt:       # before it listened
        return _interrupted(INTERRUPTED)
    if words is None:
        leave_what_is_aside(code)
    return code


def _do(words, listener):
    """Do what the words ask for; the exit code."""
    try:
        from functools import partial
        import warnings
        with warnings.catch_warnings():
            warnings.showwarning = partial(_show, warnings.showwarning)
            arguments = parse(words)
            return arguments.run(arguments)
    except BaseException as error:
        if listener.number and not listener.heard:      # whatever a library has made of it
            return _interrupted(listener.hush())
        from collision_sim.checks import SceneError
        if isinstance(error, (SceneError, OSError)):
            print(f'collision_sim: {error}', file=sys.stderr)
            return REFUSED
        if isinstance(error, MemoryError):
            print(f'collision_sim: not enough memory: {error}', file=sys.stderr)
            return REFUSED
        raise


def _interrupted(code):
    """Say so; the exit code."""
    print('collision_sim: interrupted', file=sys.stderr)
    return code


if __name__ == '__main__':
    sys.exit(main())
