// SPDX-License-Identifier: BSD-3-Clause
// Plots as inline SVG, drawn at the width they have, so that their text keeps its size on a phone.

const kRowHeight = 22;
const kNumRowsFirst = 16;

// A scale from values to [0, 1] that starts at zero; logarithmic where a few would squash the rest.
function makeScale(values) {
  const positive = values.filter((value) => isNumber(value) && value > 0);
  const high = Math.max(...positive, 1e-9);
  const middle = median(positive) || high;
  if (high / middle < 20) {
    return { log: false, high, at: (value) => clamp(value / (high * 1.04), 0, 1), ticks: linearTicks(high) };
  }
  const first = Math.floor(Math.log10(Math.max(Math.min(...positive), high * 1e-6)));
  const last = Math.ceil(Math.log10(high));
  const ticks = [];
  for (let k = first; k <= last; ++k) ticks.push(10 ** k);
  const at = (value) => (value > 0 ? clamp((Math.log10(value) - first) / (last - first), 0, 1) : 0);
  return { log: true, high, at, ticks };
}

function linearTicks(high) {
  const rough = high / 4;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough) || rough;
  const ticks = [];
  for (let k = 0; k * step <= high * 1.04; ++k) ticks.push(Number((k * step).toPrecision(6)));
  return ticks;
}

function axis(scale, layout, height, unit) {
  const marks = scale.ticks.map((tick, i) => {
    const x = layout.left + scale.at(tick) * layout.width;
    const label = formatTick(tick) + (i === scale.ticks.length - 1 && unit ? ` ${unit}` : '');
    return [
      svg('line', { class: 'grid', x1: x, x2: x, y1: 20, y2: height }),
      svg('text', { class: 'tick', x, y: 12, 'text-anchor': i === 0 ? 'start' : 'middle' }, label),
    ];
  });
  return svg('g', { 'aria-hidden': 'true' }, marks);
}

function chartRow(row, y, layout, scale, unit) {
  const before = isNumber(row.before) ? layout.left + scale.at(row.before) * layout.width : null;
  const after = isNumber(row.after) ? layout.left + scale.at(row.after) * layout.width : null;
  const says = [isNumber(row.before) && formatNumber(row.before), isNumber(row.after) && formatNumber(row.after)]
    .filter(Boolean).join(' to ');
  const marks = [];
  if (row.bar && after !== null) {
    marks.push(svg('rect', { class: 'bar', x: layout.left, y: y - 5, width: Math.max(1, after - layout.left), height: 10 }));
  } else {
    if (before !== null && after !== null) {
      marks.push(svg('line', { class: after > before + 1 ? 'stem worse' : 'stem', x1: before, x2: after, y1: y, y2: y }));
    }
    if (before !== null) marks.push(svg('circle', { class: 'before', cx: before, cy: y, r: 5 }));
    if (after !== null) marks.push(svg('circle', { class: 'after', cx: after, cy: y, r: 5.5 }));
  }
  const letters = Math.floor((layout.left - 10) / 7);
  return svg('g', { class: 'row', onclick: () => openView(row.view) },
    svg('title', {}, `${row.name}: ${says} ${unit}`),
    svg('rect', { class: 'hit', x: 0, y: y - kRowHeight / 2, width: layout.total, height: kRowHeight }),
    svg('text', { class: 'name', x: layout.left - 8, y: y + 4, 'text-anchor': 'end' }, shorten(row.name, letters)),
    marks,
    svg('text', { class: 'value', x: layout.total, y: y + 4, 'text-anchor': 'end' }, says));
}

// Rows {name, view, before, after, bar}, the worst first.
function drawRows(rows, unit, total, label) {
  const longest = Math.max(...rows.map((row) => [...row.name].length));
  const left = Math.min(longest * 7 + 16, total * 0.3);
  const right = rows.some((row) => isNumber(row.before)) ? 104 : 56;
  const layout = { left, width: Math.max(40, total - left - right), total };
  const scale = makeScale(rows.flatMap((row) => [row.before, row.after]));
  const height = 24 + rows.length * kRowHeight;
  return svg('svg', { class: 'chart', role: 'img', 'aria-label': label, width: total, height, viewBox: `0 0 ${total} ${height}` },
    axis(scale, layout, height, scale.log ? `${unit} (log)` : unit),
    rows.map((row, i) => chartRow(row, 24 + (i + 0.5) * kRowHeight, layout, scale, unit)));
}

// Steps of two histograms over one axis: { first, step, counts } each.
function drawHistogram(before, after, unit, total, label) {
  const height = 190;
  const plot = { left: 8, right: total - 8, top: 10, bottom: height - 26 };
  const both = [before, after].filter(Boolean);
  const low = Math.min(...both.map((h) => h.first));
  const high = Math.max(...both.map((h) => h.first + h.step * h.counts.length));
  const most = Math.max(1, ...both.flatMap((h) => h.counts));
  const x = (value) => plot.left + ((value - low) / (high - low)) * (plot.right - plot.left);
  const y = (count) => plot.bottom - (count / most) * (plot.bottom - plot.top);
  const outline = (h) => h.counts.reduce(
    (path, count, i) => `${path}V${y(count)}H${x(h.first + h.step * (i + 1))}`, `M${x(h.first)} ${plot.bottom}`) + `V${plot.bottom}`;
  const ticks = linearTicks(high).filter((tick) => tick >= low && tick <= high);
  return svg('svg', { class: 'chart', role: 'img', 'aria-label': label, width: total, height, viewBox: `0 0 ${total} ${height}` },
    before && svg('path', { class: 'steps before', d: outline(before) }),
    after && svg('path', { class: 'steps after', d: outline(after) }),
    svg('line', { class: 'grid', x1: plot.left, x2: plot.right, y1: plot.bottom, y2: plot.bottom }),
    ticks.map((tick, k) => svg('text', {
      class: 'tick', x: x(tick), y: height - 8, 'text-anchor': x(tick) < 30 ? 'start' : x(tick) > total - 40 ? 'end' : 'middle',
    }, formatTick(tick) + (k === ticks.length - 1 && unit ? ` ${unit}` : ''))));
}

const legend = (pair, bars) => bars ? null : el('p', { class: 'legend' }, pair.map((modelIdx, k) => modelIdx < 0 ? null
  : el('span', {}, el('span', { class: `dot ${k === 0 ? 'before' : 'after'}`, 'aria-hidden': 'true' }), models[modelIdx].name)));

// A plot with its words; `draw(width)` gives the SVG anew whenever the width changes.
function chartBox(title, words, pair, bars, draw, extra) {
  const place = el('div', { class: 'plot' });
  const redraw = (width) => place.replaceChildren(draw(Math.max(240, Math.floor(width))));
  new ResizeObserver((entries) => redraw(entries[0].contentRect.width)).observe(place);
  return el('article', { class: 'box' }, el('h3', {}, title), el('p', { class: 'help' }, words), legend(pair, bars), place, extra);
}

function rowsOf(key, bars) {
  const [before, after] = chosenPair();
  const rows = views.map((view, i) => ({
    name: String(view.name), view: i, bar: bars, after: viewValue(view, after, key),
    before: bars || before < 0 ? null : viewValue(view, before, key),
  })).filter((row) => isNumber(row.after) || isNumber(row.before));
  const rank = (row) => (isNumber(row.after) ? row.after : Infinity);
  return rows.sort((p, q) => (rank(q) === rank(p) ? 0 : rank(q) - rank(p)));
}

function viewChart(key, title, words, bars = false) {
  const rows = rowsOf(key, bars);
  if (rows.length === 0 || (bars && rows.every((row) => row.after === 0))) return null;
  const unit = viewFigure(key).unit;
  const shown = () => (state.all === '1' ? rows : rows.slice(0, kNumRowsFirst));
  const more = rows.length > kNumRowsFirst && el('button', { type: 'button', class: 'quiet', onclick: () => {
    changeState({ all: state.all === '1' ? '0' : '1' });
    showPlots();
  } }, state.all === '1' ? `Show the ${kNumRowsFirst} largest` : `Show all ${rows.length}`);
  return chartBox(title, words, chosenPair(), bars, (width) => drawRows(shown(), unit, width,
    `${title}: ${rows.length} photos, largest ${withUnit(rows[0].after, unit)} for ${rows[0].name}`), more);
}

function histogramChart(key, unit, title, words) {
  const [before, after] = chosenPair().map((i) => models[i] && models[i][key]);
  const usable = (h) => (h && list(h.counts).length && h.step > 0 ? h : null);
  if (!usable(before) && !usable(after)) return null;
  return chartBox(title, words, chosenPair(), false, (width) => drawHistogram(usable(before), usable(after), unit, width, title));
}

function showPlots() {
  const [before, after] = chosenPair();
  const pair = before < 0 ? '' : `${models[before].name} to ${models[after].name}`;
  const histograms = [
    histogramChart('error_histogram', 'px', 'Reprojection errors', 'How many observations have which error.'),
    histogramChart('track_histogram', 'photos', 'Track lengths', 'How many points are seen in how many photos.'),
  ].filter(Boolean);
  const charts = after < 0 ? [] : [
    viewChart(errorKey, errorKey === 'held_out_px' ? 'Held-out error of each photo' : 'Reprojection error of each photo',
      `${errorKey === 'held_out_px' ? 'Robust mean' : 'Median'}, in pixels of the photo; the worst first. Further left is better.`),
    viewChart('rotation_change_deg', 'How far each camera turned', `Degrees from ${pair}, after alignment.`, true),
    viewChart('centre_change_percent', 'How far each camera moved', `From ${pair}, after alignment, in % of the cameras’ extent.`, true),
    viewChart('rotation_error_deg', 'Rotation against the reference', 'Error of each camera in degrees, after alignment.'),
    viewChart('centre_error_percent', 'Centre against the reference', 'Error of each camera, after alignment, in % of the cameras’ extent.'),
    histograms.length > 0 && el('div', { class: 'stack' }, histograms),
  ].filter(Boolean);
  byId('plots').hidden = charts.length === 0;
  put(byId('plots'), el('h2', { id: 'plots-title' }, 'Photo by photo'), el('div', { class: 'charts' }, charts));
}
