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
Search by hand for combinations of features that break a promise.

    NUMBA_DISABLE_JIT=1 python -m test.combinations --minutes 60 --workers 2
    NUMBA_DISABLE_JIT=1 python -m test.combinations --replay test/combinations/failures/*.yaml
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
import datetime
from itertools import count
import multiprocessing
from pathlib import Path
import sys
import time

sys.path.insert(0, str(Path(__file__).parent))     # as pytest does

from checks import CHECKS, RUNS  # noqa: E402
from replay import load, replay  # noqa: E402
from search import kind, search, text  # noqa: E402


def seed_of_the_day():
    """Give a seed that is new each day, such as 20260930."""
    return int(f'{datetime.date.today():%Y%m%d}')


def main():
    """Run the command line."""
    parser = argparse.ArgumentParser(prog='python -m test.combinations', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--minutes', type=float, default=3.0, help='how long; default 3')
    parser.add_argument('--seed', type=int, default=seed_of_the_day(),
                        help='of all cases; default: that of the day')
    parser.add_argument('--first', type=int, default=0, help='number of the first case')
    parser.add_argument('--workers', type=int, default=1, help='processes')
    parser.add_argument('--check', action='append', choices=[*CHECKS, RUNS],
                        help='only this one; may be given several times')
    parser.add_argument('--without', metavar='SECTION',
                        help='leave out scenes with a section, such as pairs')
    parser.add_argument('--out', type=Path, help='folder for the failures, as YAML')
    parser.add_argument('--replay', type=Path, nargs='+', help='examine these cases again')
    parser.add_argument('--mutants', action='store_true',
                        help='put faults in on purpose, one by one, and search for them')
    options = parser.parse_args()
    if options.replay:
        return max([_replay(path) for path in options.replay])
    if options.mutants:
        from mutants import hunt
        return hunt(options.seed, options.minutes)
    print(f'seed {options.seed}', flush=True)
    jobs = [(options, worker) for worker in range(options.workers)]
    if options.workers == 1:
        results = [_work(*jobs[0])]
    else:
        context = multiprocessing.get_context('fork')     # spawn finds no functions here
        with ProcessPoolExecutor(options.workers, mp_context=context) as pool:
            results = list(pool.map(_work, *zip(*jobs)))
    return _report(results)


def _work(options, worker):
    """Search as one of several workers; each has every so-manieth case."""
    start, told = time.monotonic(), [0.0]

    def tell(done, found):
        if found:
            print(f'\n# {kind(found)}, after {found.after:.0f} s\n{text(found)}', flush=True)
            if options.out:
                options.out.mkdir(parents=True, exist_ok=True)
                name = f'{found.check}-{"-".join(map(str, found.seed))}.yaml'
                (options.out / name).write_text(text(found))
        elif time.monotonic() - told[0] > 5.0 and worker == 0:
            told[0] = time.monotonic()
            rate = 60.0 * done.scenes / (time.monotonic() - start)
            print(f'{(time.monotonic() - start) / 60.0:6.1f} min  {done.scenes} scenes a worker, '
                  f'{rate:.0f} a minute, {sum(done.failed.values())} failures of '
                  f'{len(done.failed)} checks', file=sys.stderr, flush=True)

    return search(options.seed, 60.0 * options.minutes,
                  count(options.first + worker, options.workers), options.check, tell,
                  without=options.without)


def _report(results):
    """Say in the end what has been done; 1 where something failed."""
    print(f'\n{sum(done.scenes for done in results)} scenes, of which '
          f'{sum(done.refused for done in results)} were not accepted')
    failed = 0
    for name in [RUNS, *CHECKS]:
        applied = sum(done.applied[name] for done in results)
        wrong = sum(done.failed[name] for done in results)
        failed += wrong
        print(f'{name:36}{applied:8} examined{wrong:8} failed' if name != RUNS else
              f'{name:36}{"all":>8} examined{wrong:8} failed')
    return 1 if failed else 0


def _replay(path):
    problem = replay(*load(path))
    print(f'{path}: {problem or "holds"}')
    return 1 if problem else 0


if __name__ == '__main__':
    sys.exit(main())
