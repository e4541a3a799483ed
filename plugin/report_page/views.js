// SPDX-License-Identifier: BSD-3-Clause
// The grid of photos, and the details of one.

const kOrders = {
  worst: ['worst error first', (view) => -(viewValue(view, chosenPair()[1], errorKey) ?? Infinity)],
  change: ['turned most first', (view) => -(viewValue(view, chosenPair()[1], 'rotation_change_deg') ?? -1)],
  excluded: ['most excluded first', (view) => -(view.excluded_percent ?? -1)],
  name: ['as listed', () => 0],
};

// The photo with what its mask excludes on top; both fill the same box.
function picture(view, eager) {
  const ratio = view.width > 0 && view.height > 0 ? `${view.width} / ${view.height}` : '4 / 3';
  const image = (source, className, alt) => source && el('img', { class: className, src: source, alt, loading: eager ? 'eager' : 'lazy', decoding: 'async' });
  const place = el('span', { class: 'picture' },
    image(view.thumbnail, 'photo', `Photo ${view.name}`) || el('span', { class: 'no-picture' }, 'no picture'),
    image(view.overlay, 'overlay', `Photo ${view.name} with excluded pixels tinted`));
  place.style.aspectRatio = ratio;
  return place;
}

function pairText(view, key) {
  const [before, after] = chosenPair();
  const values = [before, after].filter((i) => i >= 0).map((i) => viewValue(view, i, key));
  if (values.every((value) => value === null)) return null;
  const unit = viewFigure(key).unit;
  return `${values.map(formatNumber).join(' → ')}\u00a0${unit}`;
}

function viewCard(i) {
  const view = views[i];
  const turned = viewValue(view, chosenPair()[1], 'rotation_change_deg');
  return el('li', {}, el('button', { type: 'button', class: 'card view', 'data-view': i, onclick: () => openView(i) },
    picture(view, false),
    el('span', { class: 'name', title: view.name }, shorten(String(view.name), 34)),
    badge(viewStatus(view)),
    el('span', { class: 'line' }, pairText(view, errorKey) || 'no error known'),
    isNumber(turned) && turned > 0 && el('span', { class: 'line' }, `turned ${withUnit(turned, '°')}`),
    isNumber(view.excluded_percent) && el('span', { class: 'line' }, `${withUnit(view.excluded_percent, '%')} excluded`)));
}

function listedViews() {
  const order = (kOrders[state.sort] || kOrders.worst)[1];
  const wanted = state.find.toLowerCase();
  return views.map((view, i) => i)
    .filter((i) => (state.status === 'all' || viewStatus(views[i]) === state.status)
      && String(views[i].name).toLowerCase().includes(wanted))
    .sort((p, q) => { const d = order(views[p]) - order(views[q]); return Number.isNaN(d) || d === 0 ? p - q : d; });
}

function fillGrid() {
  const indices = listedViews();
  put(byId('grid'), ...indices.map(viewCard));
  byId('grid').classList.toggle('show-overlay', state.overlay === '1');
  byId('grid-count').textContent = `${indices.length} of ${views.length} photos`;
}

const option = (value, text, chosen) => el('option', { value, selected: value === chosen }, text);

function gridControls() {
  const statuses = [...new Set(views.map(viewStatus))].filter(Boolean);
  const change = (key, read) => (event) => { changeState({ [key]: read(event.target) }); fillGrid(); };
  return el('div', { class: 'controls' },
    views.some((view) => view.overlay) && el('label', {},
      el('input', { type: 'checkbox', id: 'overlay', checked: state.overlay === '1', onchange: change('overlay', (box) => (box.checked ? '1' : '0')) }),
      ' Show masks and features'),
    el('label', {}, 'Order ', el('select', { onchange: change('sort', (box) => box.value) },
      Object.entries(kOrders).map(([key, [text]]) => option(key, text, state.sort)))),
    statuses.length > 1 && el('label', {}, 'Show ', el('select', { onchange: change('status', (box) => box.value) },
      option('all', 'all photos', state.status), statuses.map((status) => option(status, kStatus[status].text, state.status)))),
    views.length > 12 && el('label', {}, 'Name ', el('input', { type: 'search', size: 12, value: state.find, oninput: change('find', (box) => box.value) })),
    el('span', { id: 'grid-count', class: 'help', role: 'status' }));
}

const overlayLegend = () => views.some((view) => view.overlay) && el('p', { class: 'legend overlay-legend' },
  el('span', {}, el('span', { class: 'swatch excluded', 'aria-hidden': 'true' }), 'magenta: excluded by the mask'),
  el('span', {}, el('span', { class: 'dot kept', 'aria-hidden': 'true' }), 'green: features that the model uses'));

// All figures as a table, for screen readers, for copying, and for who wants them exactly.
function viewTable() {
  const [before, after] = chosenPair();
  const pair = [before, after].filter((i) => i >= 0);
  const figures = kViewFigures.filter((figure) => views.some((view) => pair.some((i) => viewValue(view, i, figure.key) !== null)));
  const head = figures.flatMap((figure) => pair.map((i) => el('th', { scope: 'col' }, `${figure.label}${figure.unit && `, ${figure.unit}`}`,
    el('br'), el('span', { class: roleClass(i) }, models[i].name))));
  const fillTable = (event) => {
    if (!event.target.open || event.target.querySelector('table')) return;
    event.target.append(el('div', { class: 'scroll', tabindex: 0, role: 'region', 'aria-label': 'Figures of all photos' }, el('table', {},
      el('thead', {}, el('tr', {}, el('th', { scope: 'col' }, 'Photo'), head)),
      el('tbody', {}, views.map((view) => el('tr', {}, el('th', { scope: 'row' }, String(view.name)),
        figures.flatMap((figure) => pair.map((i) => el('td', {}, formatNumber(viewValue(view, i, figure.key)))))))))));
  };
  return el('details', { class: 'table-of-views', ontoggle: fillTable }, el('summary', {}, 'All figures of all photos as a table'));
}

function showViews() {
  byId('views').hidden = views.length === 0;
  if (views.length === 0) return;
  put(byId('views'), el('h2', { id: 'views-title' }, 'The photos'),
    el('p', { class: 'help hint' }, 'Choose a photo for its details; there, arrow keys lead to the next.'),
    gridControls(), overlayLegend(), el('ul', { id: 'grid', class: 'grid' }), viewTable());
  fillGrid();
}

function openView(i) {
  if (views[i]) changeState({ view: String(views[i].name) }, true);
  showDetails();
}

function closeDetails() {
  if (state.view !== '') changeState({ view: '' });
  showDetails();
}

function step(direction) {
  const indices = listedViews();
  const all = indices.length ? indices : views.map((view, i) => i);
  const at = all.findIndex((i) => views[i].name === state.view);
  const next = all[(at + direction + all.length) % all.length];
  changeState({ view: String(views[next].name) });
  showDetails();
}

function detailTable(view) {
  const shown = models.map((model, i) => i).filter((i) => list(view.by_model)[i]);
  const figures = kViewFigures.filter((figure) => shown.some((i) => viewValue(view, i, figure.key) !== null));
  if (figures.length === 0) return el('p', { class: 'help' }, 'No figures are known of this photo.');
  return el('div', { class: 'scroll' }, el('table', {},
    el('thead', {}, el('tr', {}, el('td', {}), shown.map((i) => el('th', { scope: 'col', class: roleClass(i) }, models[i].name)))),
    el('tbody', {}, figures.map((figure) => el('tr', {}, el('th', { scope: 'row' }, figure.label),
      shown.map((i) => el('td', {}, withUnit(viewValue(view, i, figure.key), figure.unit))))))));
}

function detailWords(view) {
  const why = list(data.guilty).find((entry) => entry.name === view.name);
  const statuses = models.map((model, i) => {
    const entry = list(view.by_model)[i];
    const status = entry ? entry.status : null;
    if (!status && !(entry && entry.reason)) return null;
    return el('p', {}, `${model.name}: `, badge(status), entry.reason ? ` ${entry.reason}` : null);
  });
  return [why && el('p', { class: 'note' }, 'Look at this first: ', String(why.why)), statuses,
    el('p', { class: 'help' }, [view.width > 0 && `${view.width} × ${view.height} pixels`,
      isNumber(view.excluded_percent) && `${withUnit(view.excluded_percent, '%')} excluded by its mask`].filter(Boolean).join(' · '))];
}

function showDetails() {
  const dialog = byId('details');
  const view = views.find((candidate) => candidate.name === state.view);
  if (!view) {
    if (dialog.open) dialog.close();
    return;
  }
  const button = (text, label, action) => el('button', { type: 'button', 'aria-label': label, onclick: action }, text);
  const stage = el('div', { class: `stage${state.overlay === '1' ? ' show-overlay' : ''}` }, picture(view, true));
  const toggle = view.overlay && view.thumbnail && el('label', {}, el('input', { type: 'checkbox', id: 'detail-overlay', checked: state.overlay === '1',
    onchange: (event) => { changeState({ overlay: event.target.checked ? '1' : '0' }); stage.classList.toggle('show-overlay', event.target.checked); },
  }), ' Show mask and features (M)');
  put(dialog, 
    el('div', { class: 'bar-top' }, button('←', 'Previous photo', () => step(-1)), el('h2', { id: 'details-title', tabindex: '-1' }, String(view.name)),
      button('→', 'Next photo', () => step(1)), button('✕', 'Close', closeDetails)),
    stage, el('div', { class: 'controls' }, toggle,
      hasScene() && el('button', { type: 'button', onclick: () => { closeDetails(); showInScene(views.indexOf(view)); } }, 'Show it in 3D')),
    detailWords(view), detailTable(view));
  if (!dialog.open) dialog.showModal();
  byId('details-title').focus();
}

byId('details').addEventListener('keydown', (event) => {
  if (event.altKey || event.ctrlKey || event.metaKey) return;
  if (event.key === 'ArrowLeft') step(-1);
  else if (event.key === 'ArrowRight') step(1);
  else if (event.key === 'm' || event.key === 'M') byId('detail-overlay')?.click();
  else return;
  event.preventDefault();
});
byId('details').addEventListener('close', () => { if (state.view !== '') closeDetails(); });
byId('details').addEventListener('click', (event) => { if (event.target === byId('details')) closeDetails(); });
