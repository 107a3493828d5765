"""The seed paper (Pietruszczak, on accelerometers with fractional orders): its tables and figures
again, its claims audited, and its experiment done properly on the bench's bags.
"""

from ..io.shared_files import shared_folder
from ._common import (
    add_json,
    add_report,
    provenance,
    require_report,
    share_done,
    write_json,
    write_page,
)

BAGS = shared_folder("bags")
EXAMPLES = """
frac_accel paper --quick
frac_accel paper --report paper.html
"""


def add_arguments(parser):
    """Options of the verb."""
    parser.add_argument("--quick", action="store_true",
                        help="tables, figures and audit only, without the study (seconds instead "
                             "of minutes)")
    parser.add_argument("--bags", metavar="FOLDER", default=str(BAGS),
                        help="folder of the study's bags (default: %(default)s)")
    add_report(parser)
    add_json(parser)


def run(arguments):
    """Do it."""
    from ..paper import reproduce
    require_report(arguments.report)
    with share_done() as show:
        result = reproduce(not arguments.quick, arguments.bags, show)
    print(table(result))
    if arguments.report:
        from ..report.paper import paper_page
        write_page(paper_page(result, _provenance(arguments, result)), arguments.report)
    write_json(arguments.json, result.as_dict())


def table(result):
    """A `PaperResult` as text."""
    lines = []
    for number, content in result.tables.items():
        lines.append(f"Table {number}: {content.title}")
        for column in content.columns:
            lines.append(f"  {column.name}: {column.status}")
            for name, cells in (("paper", column.printed), ("computed", column.computed)):
                if cells:
                    lines.append(f"    {name:9}" + "".join(f"{cell:10.4f}" for cell in cells))
    lines.append("Claims")
    width = max(len(claim.key) for claim in result.claims)
    lines += [f"  {claim.key:{width}}  {claim.status}" for claim in result.claims]
    if result.study is not None:
        lines += ["Study", *(f"  {line}" for line in result.study.words())]
    return "\n".join(lines)


def _provenance(arguments, result):
    command = "frac_accel paper" + (" --quick" if arguments.quick else "")
    if result.study is None:
        return {"command": command}
    all_bags = [provenance(bag, command) for bag in result.study.bags]
    return {**all_bags[0], **{key: [each[key] for each in all_bags] for key in ("bag", "sha256")}}
