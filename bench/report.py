"""Bring the tables of docs/benchmarks.md up to date: `python -m bench.report`, after the benchmarks have been run.

Between `<!-- results: NAME -->` and `<!-- end -->` it puts what `bench/results/NAME.json` holds.
"""

from __future__ import annotations

import re

from bench.measure import RESULTS, ROOT, Report, require

DOCUMENT = ROOT / "docs" / "benchmarks.md"
PLACE = re.compile(r"(<!-- results: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def main() -> None:
    def filled(place: re.Match[str]) -> str:
        report = Report.read(require(RESULTS / f"{place[2]}.json"))
        return f"{place[1]}\n{markdown(report)}\n{place[3]}"

    document, count = PLACE.subn(filled, DOCUMENT.read_text())
    DOCUMENT.write_text(document)
    print(f"{count} places of docs/{DOCUMENT.name} brought up to date")


def markdown(report: Report) -> str:
    """The command, the machine, and the tables."""
    machine = report.machine
    versions = ", ".join(f"{package} {machine[package]}" for package in ("python", "numpy", "llvmlite", "embreex"))
    lines = [
        f"`{report.command}`, {report.rounds} rounds; {machine['processor']}, {machine['cores']} cores, "
        f"{machine['lanes']} lanes; {machine['system']}; {versions}; load {machine['load']} when it began.",
        *(table.markdown() for table in report.tables),
    ]
    return "\n\n".join(lines)


if __name__ == "__main__":
    main()
