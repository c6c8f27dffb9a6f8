#!/usr/bin/env python3
"""Runs jobs of plans that `gs4d bake --plan` has written, in the order of the plan.

    run.py PLAN.json            all jobs of a plan
    run.py PLAN.json ID...      these jobs
    run.py FOLDER I/N           all jobs of every N-th plan of the folder, by name, from plan I on: share I of N, from 0

In: plans; `gs4d` in the PATH. Out: the outputs of the jobs; the exit code of a job that fails, or 128 + signal if a
signal has ended it. After a job that fails the other plans of the share still run, after a signal they do not. A job
whose results are stored ends at once: the same call resumes.
"""

import json
import subprocess
import sys
from pathlib import Path


def refuse(message):
    print(f"error: {message}", file=sys.stderr)
    sys.exit(2)


def run(place, names=()):
    """Runs jobs of a plan. Returns the exit code of the first that fails, or 0."""
    try:
        plan = json.loads(place.read_text())
        directory, jobs = plan["directory"], {job["id"]: job["command"] for job in plan["jobs"]}
    except (OSError, ValueError, KeyError, TypeError) as error:
        print(f"error: {place} is no plan of gs4d: {error}", file=sys.stderr)
        return 2
    for name in names or jobs:
        if name not in jobs:
            refuse(f"{place} has no job {name}; there are: {', '.join(jobs)}")
        try:
            code = subprocess.run(jobs[name], cwd=directory, stdin=subprocess.DEVNULL).returncode
        except OSError as error:
            print(f"error: {place}, job {name}: {error}", file=sys.stderr)
            return 2
        if code:
            print(f"error: {place}: the job {name} has failed", file=sys.stderr)
            return 128 - code if code < 0 else code
    return 0


def run_share(folder, share):
    """Runs every N-th plan of a folder. Returns the last exit code that is not 0, or 0."""
    index, _, count = share.partition("/")
    if not (index.isdigit() and count.isdigit() and int(index) < int(count)):
        refuse(f"{share} is no share I/N: there are those from 0/N to N-1/N")
    plans = sorted(folder.glob("*.json"))
    if not plans:
        refuse(f"{folder} has no plans")
    last = 0
    for plan in plans[int(index) :: int(count)]:
        last = run(plan) or last
        if last > 128:
            break
    return last


if __name__ == "__main__":
    place = Path(sys.argv[1] if len(sys.argv) > 1 else refuse(__doc__))
    if place.is_dir():
        sys.exit(run_share(place, sys.argv[2]) if len(sys.argv) == 3 else refuse(f"{place} is a folder: give a share I/N"))
    sys.exit(run(place, sys.argv[2:]))
