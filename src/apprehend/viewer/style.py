"""The style sheet and the script of the report: plain CSS and JavaScript, no network."""

from __future__ import annotations

CSS = (
    """
:root { color-scheme: light dark;
  --page:#f6f7f9; --card:#ffffff; --ink:#1c2430; --soft:#5b6675; --line:#dde2e8; --band:#eef1f5; --good:#1d7a4a;
  --good-soft:#dff3e7; --bad:#b3261e; --bad-soft:#fbe4e1; --limit:#b3261e; --quiet:#b4bcc6; --bar:#9db4d6;
  --s0:#2f6db5; --s1:#d9730d; --s2:#2e9e6b; --s3:#b8408f; --s4:#7a5fc0; --s5:#0f8fa3; --s6:#9a7b0a; --s7:#c2413b; }
@media (prefers-color-scheme: dark) { :root {
  --page:#12161c; --card:#1a2029; --ink:#e7ebf0; --soft:#9aa6b5; --line:#2d3642; --band:#202833; --good:#5fd394;
  --good-soft:#163626; --bad:#ff8a80; --bad-soft:#3d1c1a; --limit:#ff8a80; --quiet:#566271; --bar:#46628c;
  --s0:#6aa6ea; --s1:#f09a4a; --s2:#55c995; --s3:#e07cc0; --s4:#a894ea; --s5:#4cc4d8; --s6:#d3b44a; --s7:#f08a82; } }
* { box-sizing: border-box; }
body { margin:0; background:var(--page); color:var(--ink); line-height:1.5;
  font:15px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"Liberation Sans",sans-serif; }
main { max-width:1120px; margin:0 auto; padding:28px 20px 60px; }
h1 { font-size:26px; line-height:1.2; margin:0 0 6px; letter-spacing:-0.01em; }
h2 { font-size:18px; margin:38px 0 12px; }
h3 { font-size:14px; margin:0 0 2px; font-weight:600; }
p { margin:0; } .soft { color:var(--soft); }
.verdict { display:flex; gap:12px; align-items:baseline; flex-wrap:wrap; margin-bottom:20px; }
.badge { font-weight:650; border-radius:999px; padding:2px 12px; background:var(--good-soft); color:var(--good); }
.badge.bad { background:var(--bad-soft); color:var(--bad); }
.top { display:grid; grid-template-columns:minmax(0,1.75fr) minmax(0,1fr); gap:16px; }
figure { margin:0; } img { display:block; width:100%; height:auto; border-radius:10px; border:1px solid var(--line); }
figcaption { color:var(--soft); font-size:13px; padding-top:5px; } figcaption b { color:var(--ink); font-weight:600; }
.tiles { display:grid; grid-template-columns:1fr 1fr; gap:10px; align-content:start; }
.tile, .card { background:var(--card); border:1px solid var(--line); border-radius:10px; padding:12px 14px; }
.tile .value { font-size:22px; font-weight:620; letter-spacing:-0.01em; font-variant-numeric:tabular-nums; }
.tile .value small { font-size:14px; font-weight:500; color:var(--soft); }
.tile .name { color:var(--soft); font-size:13px; }
.film { display:grid; grid-template-columns:repeat(auto-fill,minmax(240px,1fr)); gap:14px; }
.scroll { overflow-x:auto; } table { border-collapse:collapse; width:100%; font-variant-numeric:tabular-nums; }
th, td { text-align:left; padding:8px 10px; border-bottom:1px solid var(--line); vertical-align:top; }
th { font-size:13px; color:var(--soft); font-weight:550; } tr:last-child > td { border-bottom:0; }
td.n { text-align:right; white-space:nowrap; } th.n { text-align:right; }
.mark { display:inline-block; width:20px; font-weight:700; } .ok { color:var(--good); } .no { color:var(--bad); }
.bar { display:block; height:4px; border-radius:2px; background:var(--bar); margin:5px 0 0 auto; }
dl { display:grid; grid-template-columns:max-content 1fr; gap:1px 10px; margin:0; font-size:13px; }
dt { color:var(--soft); } dd { margin:0; font-variant-numeric:tabular-nums; overflow-wrap:anywhere; }
details summary { cursor:pointer; color:var(--soft); font-size:13px; } details dl { margin-top:6px; }
.charts, .joints { display:grid; gap:14px; } .joints { grid-template-columns:repeat(auto-fill,minmax(300px,1fr)); }
td.margins { min-width:200px; } td:nth-child(2) { min-width:150px; } td.margins dd { white-space:nowrap; }
.card header { display:flex; justify-content:space-between; gap:10px; align-items:baseline; flex-wrap:wrap; }
.card header.small { display:block; } .card header.small .readout { display:block; }
.pair { display:grid; grid-template-columns:repeat(auto-fit,minmax(320px,1fr)); gap:16px; }
.card header span { color:var(--soft); font-size:13px; font-variant-numeric:tabular-nums; }
svg.chart { display:block; width:100%; height:auto; overflow:visible; }
svg text { font-size:11px; fill:var(--soft); font-family:inherit; font-variant-numeric:tabular-nums; }
svg text.y, svg text.unit, svg text.limit { text-anchor:end; } svg text.x { text-anchor:middle; }
svg text.x.unit { text-anchor:end; } svg text.band { text-anchor:middle; font-size:10.5px; }
svg text.limit { fill:var(--limit); }
svg .grid { stroke:var(--line); stroke-width:1; }
svg .limit { stroke:var(--limit); stroke-dasharray:5 4; stroke-width:1.2; }
svg text.limit { stroke:none; } svg .band0 { fill:transparent; } svg .band1 { fill:var(--band); }
svg .line { fill:none; stroke-width:1.6; stroke-linejoin:round; } svg .line.quiet { stroke:var(--quiet); }
svg .cursor { stroke:var(--soft); stroke-width:1; }
.legend { display:flex; flex-wrap:wrap; gap:2px 14px; font-size:13px; color:var(--soft); }
.key::before { content:""; display:inline-block; width:14px; height:3px; border-radius:2px; margin:0 6px 3px 0;
  background:currentColor; }
.key.quiet::before { background:var(--quiet); }
"""
    + "".join(
        f"svg .line.s{i} {{ stroke:var(--s{i}); }} .key.s{i}::before {{ background:var(--s{i}); }}\n" for i in range(8)
    )
    + """
@media (max-width:760px) { .top { grid-template-columns:1fr; } }
@media print { .card, .tile, figure { break-inside:avoid; } }
"""
)

SCRIPT = """
// One cursor through all charts: the pointer's time is marked in each, and the values there are written in its header.
const charts = [...document.querySelectorAll('svg.chart')];
const near = (times, t) => { let a = 0, b = times.length - 1;
  while (b - a > 1) { const m = (a + b) >> 1; if (times[m] <= t) a = m; else b = m; }
  return t - times[a] < times[b] - t ? a : b; };
const data = JSON.parse(document.getElementById('data').textContent);
function mark(t) {
  const i = t === null ? -1 : near(data.t, t);
  for (const svg of charts) {
    const d = svg.dataset, cursor = svg.querySelector('.cursor'), out = svg.parentElement.querySelector('.readout');
    if (t === null) { cursor.setAttribute('visibility', 'hidden');
      if (out) out.textContent = out.dataset.rest; continue; }
    const x = +d.left + +d.width * (t - d.t0) / (d.t1 - d.t0);
    cursor.setAttribute('x1', x); cursor.setAttribute('x2', x); cursor.setAttribute('visibility', 'visible');
    if (out) out.textContent = data.t[i].toFixed(2) + ' s: ' + data.charts[out.dataset.chart]
      .map(([name, values]) => (name ? name + ' ' : '') + values[i]).join('  ');
  }
}
for (const svg of charts) {
  svg.addEventListener('pointermove', e => {
    const box = svg.getBoundingClientRect(), d = svg.dataset;
    const u = (e.clientX - box.left) / box.width * svg.viewBox.baseVal.width;
    const share = Math.min(1, Math.max(0, (u - d.left) / d.width)); mark(+d.t0 + share * (d.t1 - d.t0)); });
  svg.addEventListener('pointerleave', () => mark(null));
}
"""
