"""Measures the peers on the same jobs at an equal measured error; see README.md."""

import argparse
import csv
import json
import shlex
import statistics
import subprocess
import sys

from model import BUILD, DURATION_S, ERROR_LIMIT, ERROR_TIME_S, HERE, exported

PATIENCE = 1.5
"""Finer settings are tried until one takes so many times the cheapest so far."""
REFERENCE = json.loads((HERE / "reference.json").read_text())["jobs"]
COLUMNS = (
    "peer",
    "version",
    "job",
    "cpu_s_median",
    "cpu_s_min",
    "cpu_s_max",
    "runs",
    "worst_error",
    "median_error",
    "setting",
    "mean_exponent_per_s",
    "mode_changes",
    "note",
)


def peers():
    """Every peer's name, and what makes it; a package is only loaded for its own peer."""

    def heyoka(batch):
        from peer_heyoka import Heyoka

        return Heyoka(batch)

    def numba():
        from peer_numba import Numba

        return Numba()

    def jitcode():
        from peer_jitcode import Jitcode

        return Jitcode()

    def rust(*arguments):
        from peer_rust import Rust

        return Rust(*arguments)

    no_events = {"F": "it stops at ends of steps only: no event location"}
    return {
        "heyoka-batch": lambda: heyoka(8),
        "heyoka": lambda: heyoka(1),
        "ode_solvers": lambda: rust("ode_solvers", "dop853", no_events),
        "differential-equations": lambda: rust("differential-equations", "dop853 (F: dopri5)"),
        "diffsol": lambda: rust("diffsol", "tsit45"),
        "numba": numba,
        "jitcode": jitcode,
    }


def check(peer):
    """Compares a peer's right-hand sides with the shared model's, component by component.

    The scale is each component's largest value among the samples: sums that cancel have no relative accuracy. The limit is
    1e-14 of it, 45 units in the last place.
    """
    _, samples = exported()
    scales = {
        key: [max(abs(s[key][i]) for s in samples) for i in range(4)] for key in ("rates", "tangent_rates")
    }
    compared = 0
    for sample, values in zip(samples, peer.check()):
        if values is None:
            continue
        compared += 1
        # A resting steering's neighbour is compared without its acceleration, which the samples hold at zero.
        components = {"rates": 4, "tangent_rates": 4 if sample["free"] else 3}
        for (key, scale), value in zip(scales.items(), values):
            for i in range(components[key]):
                if not abs(value[i] - sample[key][i]) <= 1e-14 * scale[i]:
                    sys.exit(f"{peer.name}: {key}[{i}] is {value[i]}, the model's {sample[key][i]}: {sample}")
    assert compared >= len(samples) // 4, compared


def errors(job, result):
    """Difference from the reference at 10 s, each lane's largest component: that of the worst lane and the median one."""
    lanes = [
        max(abs(float(a) - float(b)) for a, b in zip(x, y, strict=True))
        for x, y in zip(REFERENCE[job]["states"], result["states"], strict=True)
    ]
    return max(lanes), statistics.median(lanes)


def cheapest(peer, job):
    """What takes least time among the settings within the error limit, or None; and the least error with its setting."""
    best, least_error = None, (float("inf"), None)
    for setting in peer.settings:
        run = peer.prepare(job, setting)
        try:
            result = run(ERROR_TIME_S)
        except RuntimeError as failure:
            print(f"  {setting:.2g}: {failure}", file=sys.stderr)
            continue
        found, median = errors(job, result)
        least_error = min(least_error, (found, setting))
        if found > ERROR_LIMIT:
            continue
        try:
            cpu_s = min(run(DURATION_S)["cpu_s"] for _ in range(2))
        except RuntimeError as failure:
            print(f"  {setting:.2g}: {failure}", file=sys.stderr)
            continue
        print(f"  {setting:.2g}: error {found:.1e}, {cpu_s:.3f} s", file=sys.stderr)
        if best is None or cpu_s < best[0]:
            best = (cpu_s, found, median, setting, run, notes(job, result))
        if cpu_s > PATIENCE * best[0]:
            break
    return best, least_error


def notes(job, result):
    """What else differs from the reference at 10 s."""
    if job == "L":
        differences = [
            abs(float(a) - float(b)) for a, b in zip(REFERENCE[job]["exponents_per_s"], result["exponents_per_s"])
        ]
        return f"worst error of the exponent over the first {ERROR_TIME_S:g} s: {max(differences):.1e}/s"
    if job == "F":
        wrong = sum(abs(a - b) for a, b in zip(REFERENCE[job]["mode_changes"], result["mode_changes"]))
        return f"changes of mode missed or added in the first {ERROR_TIME_S:g} s: {wrong}"
    return ""


def measure(peer, job, runs):
    """A row of the table."""
    row = {"peer": peer.name, "version": peer.version, "job": job}
    if job in peer.cannot:
        return row | {"note": f"cannot express the job: {peer.cannot[job]}"}
    best, (least, at) = cheapest(peer, job)
    if best is None:
        where = f"least error {least:.1e} at {peer.setting_name} {at:.2g}" if at else "no run ended"
        return row | {"note": f"does not reach the error: {where}"}
    _, found, median, setting, run, note = best
    results = [run(DURATION_S) for _ in range(runs)]
    seconds = [result["cpu_s"] for result in results]
    exponents_per_s, mode_changes = (results[0].get(key, ()) for key in ("exponents_per_s", "mode_changes"))
    return row | {
        "cpu_s_median": statistics.median(seconds),
        "cpu_s_min": min(seconds),
        "cpu_s_max": max(seconds),
        "runs": runs,
        "worst_error": found,
        "median_error": median,
        "setting": f"{peer.setting_name} {setting:.2g}",
        "mean_exponent_per_s": sum(exponents_per_s) / len(exponents_per_s) if len(exponents_per_s) else "",
        "mode_changes": sum(mode_changes) if len(mode_changes) else "",
        "note": note,
    }


def own(command, jobs):
    """Rows of the project's own engine: a program that prints a JSON object per line and run; see README.md."""
    done = subprocess.run(shlex.split(command), capture_output=True, text=True, check=True)
    lines = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    for job in jobs:
        of_job = [line for line in lines if line["job"] == job]
        if not of_job:
            continue
        seconds = [line["cpu_s"] for line in of_job]
        yield {
            "peer": "this project",
            "job": job,
            "cpu_s_median": statistics.median(seconds),
            "cpu_s_min": min(seconds),
            "cpu_s_max": max(seconds),
            "runs": len(seconds),
            "worst_error": max(line["error"] for line in of_job),
            **{key: of_job[0][key] for key in COLUMNS[8:] if key in of_job[0]},
        }


def shown(value):
    """A table's cell."""
    if isinstance(value, float):
        return f"{value:.1e}" if abs(value) < 1e-4 else f"{value:.3g}"
    return str(value)


def write(rows, path):
    """The CSV file and the Markdown table."""
    with open(path.with_suffix(".csv"), "w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    cells = [COLUMNS, ["---"] * len(COLUMNS)] + [[shown(row.get(key, "")) for key in COLUMNS] for row in rows]
    table = "".join(f"| {' | '.join(line)} |\n" for line in cells)
    path.with_suffix(".md").write_text(table)
    return table


def main():
    """Reads the command line, measures, writes."""
    makers = peers()
    parser = argparse.ArgumentParser(prog="benches/peers/run", description=__doc__)
    parser.add_argument("--job", choices=[*"SLF", "all"], default="all")
    parser.add_argument("--runs", type=int, default=5, metavar="N", help="runs of each job (default 5)")
    parser.add_argument("--peer", choices=makers, action="append", help="only this one; may be repeated")
    parser.add_argument("--own", metavar="PROGRAM", help="the project's own engine, as a command")
    parser.add_argument("--output", default="peers", metavar="NAME", help="target/peers/NAME.csv and .md (default peers)")
    options = parser.parse_args()
    jobs = list("SLF") if options.job == "all" else [options.job]
    if options.runs < 1:
        parser.error("--runs: at least 1")

    rows = list(own(options.own, jobs)) if options.own else []
    for name in options.peer or makers:
        peer = makers[name]()
        check(peer)
        for job in jobs:
            print(f"{peer.name} {peer.version}, job {job}", file=sys.stderr)
            rows.append(measure(peer, job, options.runs))
    rows.sort(key=lambda row: (row["job"], row.get("cpu_s_median", float("inf"))))
    print(write(rows, BUILD / options.output), end="")


if __name__ == "__main__":
    main()
