"""One HTML page without scripts or external resources, for screen and paper: its style, and its frame."""

from collections.abc import Iterable

STYLE = """
:root{color-scheme:light dark;--ink:#20262e;--paper:#fff;--soft:#66707c;--rule:#d9dee4;--blue:#3a6ea5;--red:#c8443c;
--green:#2f7d4b;--amber:#b5731a}
@media(prefers-color-scheme:dark){:root{--ink:#e4e8ec;--paper:#15191e;--soft:#98a3af;--rule:#343c45;--blue:#7eb0e3;
--red:#ff7a70;--green:#6cc68b;--amber:#e8a33d}}
body{background:var(--paper);color:var(--ink);font:15px/1.5 system-ui,sans-serif;max-width:76rem;margin:2rem auto;
padding:0 1rem}
h1{line-height:1.2}h2{margin-top:3rem;border-bottom:1px solid var(--rule)}
table{border-collapse:collapse;font-size:13px;font-variant-numeric:tabular-nums}
th,td{padding:.2rem .55rem;text-align:right;border-bottom:1px solid var(--rule);white-space:nowrap}
th{vertical-align:bottom;color:var(--soft);font-weight:600}td.l,th.l{text-align:left}td.w{white-space:normal;min-width:14rem}
.wide{overflow-x:auto}.bad{color:var(--red);font-weight:700}.good{color:var(--green);font-weight:700}
.soft{color:var(--soft)}dt{color:var(--soft)}dl{display:grid;grid-template-columns:max-content 1fr;gap:.1rem 1rem}
dd{margin:0;overflow-wrap:anywhere}code{font-size:.92em;overflow-wrap:anywhere}
svg{max-width:100%;height:auto;font:11px system-ui,sans-serif}svg text{fill:var(--ink)}
.name{text-anchor:end}.tick{text-anchor:middle;fill:var(--soft)!important}.note{fill:var(--soft)!important}
.grid{stroke:var(--rule);fill:none}.bars{fill:var(--blue)}.bound{stroke:var(--red);stroke-width:2;fill:none}
.commanded{stroke:var(--soft);stroke-dasharray:5 3;fill:none;stroke-width:1.5}
.permitted{stroke:var(--blue);fill:none;stroke-width:1.8}.true{stroke:var(--amber);fill:none;stroke-width:2.2}
.stopped{fill:var(--red);fill-opacity:.18}.why{font-size:10px}
.key{display:inline-block;width:1.6rem;border-top:3px solid;vertical-align:middle;margin:0 .3rem 0 1rem}
figure{margin:1rem 0}figcaption{color:var(--soft);font-size:13px}
@media print{:root{--ink:#000;--paper:#fff;--soft:#444;--rule:#bbb;--blue:#245;--red:#a00;--green:#160;--amber:#840}
details{break-inside:avoid}tr,svg{break-inside:avoid}.wide{overflow:visible}table{font-size:8pt}}
"""


def document(title: str, parts: Iterable[str]) -> str:
    """Return a page that needs nothing else, with the style sheet of our pictures."""
    return "".join(
        [
            '<!doctype html><html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width,initial-scale=1">',
            f"<title>{title}</title><style>{STYLE}</style></head><body><h1>{title}</h1>",
            *parts,
            "</body></html>\n",
        ]
    )
