#!/usr/bin/env python3
"""Runs jobs of plans that `gs4d bake --plan` has written, in the order of the plan.

    run.py PLAN.json            all jobs of a plan
    run.py PLAN.json ID...      these jobs
    run.py FOLDER NUMBER        all jobs of plan NUMBER, from 0, of the folder, by name

In: plans; `gs4d` in the PATH. Out: the outputs of the jobs; the exit code of the first job that fails, or 128 + signal if a signal has
ended it. A job whose results are stored ends at once: the same call again resumes.
"""

import json
import subprocess
import sys
from pathlib import Path


def refuse(message):
    sys.exit(f"error: {message}")


def main(place, names):
    if place.is_dir():
        plans = sorted(place.glob("*.json"))
        if len(names) != 1 or not names[0].isdigit() or int(names[0]) >= len(plans):
            refuse(f"{place} has {len(plans)} plans: give one number from 0 to {len(plans) - 1}")
        place, names = plans[int(names[0])], []
    try:
        plan = json.loads(place.read_text())
        directory, jobs = plan["directory"], {job["id"]: job["command"] for job in plan["jobs"]}
    except (OSError, ValueError, KeyError, TypeError) as error:
        refuse(f"{place} is no plan of gs4d: {error}")
    for name in names or jobs:
        if name not in jobs:
            refuse(f"{place} has no job {name}; there are: {', '.join(jobs)}")
        try:
            code = subprocess.run(jobs[name], cwd=directory, stdin=subprocess.DEVNULL).returncode
        except OSError as error:
            refuse(f"{place}, job {name}: {error}")
        if code:
            print(f"{place}: the job {name} has failed", file=sys.stderr)
            sys.exit(128 - code if code < 0 else code)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        refuse(__doc__)
    main(Path(sys.argv[1]), sys.argv[2:])
