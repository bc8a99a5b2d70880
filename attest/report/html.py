"""What pages share: how they look, how their tables are sorted, and that they load nothing."""

STYLE = """
:root { color-scheme: light dark; --ink: #222; --paper: #fff; --line: #ddd; --head: #f4f4f4;
  --faint: #666; --bad: #fff0ee; --mark: #2a6fb0; --alert: #c33 }
@media (prefers-color-scheme: dark) { :root { --ink: #ddd; --paper: #181a1b; --line: #3a3d3f;
  --head: #26292b; --faint: #9a9a9a; --bad: #3a2320; --mark: #6fb1ea; --alert: #ff7a6b } }
body { font: 14px/1.4 system-ui, sans-serif; margin: 2em; color: var(--ink);
  background: var(--paper) }
a { color: var(--mark) }
table { border-collapse: collapse }
th, td { padding: .25em .6em; border-bottom: 1px solid var(--line); text-align: left;
  vertical-align: top }
th { cursor: pointer; position: sticky; top: 0; background: var(--head); white-space: nowrap }
td.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap }
td.path { overflow-wrap: anywhere; min-width: 14em }
td.path small { display: block; min-width: 30em }
tr.bad td { background: var(--bad) }
small { color: var(--faint) }
figure { display: inline-block; margin: 0 2em 1em 0; vertical-align: top }
figcaption { font-weight: 600 }
svg text { font: 11px system-ui, sans-serif; fill: var(--faint) }
"""
SCRIPT = """
function key(row, i) {
  const value = row.cells[i].dataset.v;
  return value === undefined || value === '' ? null : isNaN(value) ? value : Number(value);
}
function order(a, b) {
  if (a === null || b === null) return (a === null) - (b === null);
  if (typeof a !== typeof b) { a = String(a); b = String(b); }
  return a < b ? -1 : a > b ? 1 : 0;
}
document.querySelectorAll('th').forEach(head => head.addEventListener('click', () => {
  const body = head.closest('table').tBodies[0], i = head.cellIndex;
  const up = head.dataset.up === '1' ? -1 : 1;
  head.dataset.up = up;
  Array.from(body.rows)
    .map(row => [key(row, i), row])
    .sort((a, b) => a[0] === null || b[0] === null ? order(a[0], b[0]) : up * order(a[0], b[0]))
    .forEach(pair => body.appendChild(pair[1]));
}));
"""
POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
FOOT = f"<script>{SCRIPT}</script></body></html>\n"


def head(title: str, style: str = "") -> str:
    """Return the beginning of a page, to behind its title; a title and a style of our own."""
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        f"<style>{STYLE}{style}</style></head><body><h1>{title}</h1>"
    )


def utf8(text: str) -> str:
    """Return a text as UTF-8 can hold it."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")
