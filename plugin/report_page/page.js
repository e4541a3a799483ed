// SPDX-License-Identifier: BSD-3-Clause
// The page from top to bottom.

const kNumCards = 6;

// Both values as bars of one scale: which is longer is seen before it is read.
function pairOfBars(before, after) {
  const most = Math.max(Math.abs(before || 0), Math.abs(after || 0)) || 1;
  const bar = (value, role) => {
    const node = el('span', { class: `meter ${role}` });
    node.style.width = `${(100 * Math.abs(value)) / most}%`;
    return node;
  };
  return el('span', { class: 'meters', 'aria-hidden': 'true' }, isNumber(before) && bar(before, 'before'), isNumber(after) && bar(after, 'after'));
}

function figureCard(figure, before, after) {
  const verdict = direction(before, after, figure.better);
  const [sign, word] = kDirections[verdict] || [];
  const { unit } = figure;
  return el('article', { class: 'card' },
    el('h3', { title: figure.help || null }, figure.label),
    el('p', { class: 'values' }, isNumber(before) && [el('span', { class: 'was' }, formatNumber(before)), el('span', { class: 'arrow' }, '→')],
      el('strong', {}, formatNumber(after)), unit && el('span', { class: 'unit' }, unit)),
    isNumber(before) && pairOfBars(before, after),
    verdict && el('p', { class: `verdict ${verdict}` }, el('span', { 'aria-hidden': 'true' }, `${sign} `), `${word}`,
      verdict === 'same' ? null : el('span', { class: 'help' }, changeInWords(before, after))));
}

function showFigures() {
  const [before, after] = chosenPair();
  const section = byId('figures');
  if (after < 0) { put(section, el('p', { class: 'note' }, 'There is no model to show.')); return; }
  const figures = kModelFigures.filter((figure) => figure.key !== 'num_views' && figure.key !== 'p90_px')
    .map((figure) => [figure, modelValue(models[before], figure), modelValue(models[after], figure)])
    .filter(([, was, is]) => is !== null);
  // Figures without a better side only fill up.
  const ranked = [...figures.filter(([figure]) => figure.better), ...figures.filter(([figure]) => !figure.better)];
  const cards = ranked.slice(0, kNumCards).map((entry) => figureCard(...entry));
  put(section, comparedModels(), el('div', { class: 'cards' }, cards), guiltyBox());
}

function comparedModels() {
  const [before, after] = chosenPair();
  if (before < 0) return el('p', { class: 'legend' }, el('span', {}, el('span', { class: 'dot after' }), `Model: ${models[after].name}`));
  const chooser = (key, label, chosen) => models.length <= 2 + (referenceModel() >= 0)
    ? el('strong', {}, models[chosen].name)
    : el('select', { 'aria-label': label, onchange: (event) => { changeState({ [key]: event.target.value }); showAll(); } },
      models.map((model, i) => option(String(i), model.name, String(chosen))));
  return el('p', { class: 'legend compared' },
    el('span', {}, el('span', { class: 'dot before', 'aria-hidden': 'true' }), 'before: ', chooser('a', 'Model before', before)),
    el('span', {}, el('span', { class: 'dot after', 'aria-hidden': 'true' }), 'after: ', chooser('b', 'Model after', after)));
}

function guiltyBox() {
  const guilty = list(data.guilty);
  if (guilty.length === 0) return null;
  return el('aside', { class: 'box guilty', 'aria-labelledby': 'guilty-title' }, el('h2', { id: 'guilty-title' }, 'Look at these first'),
    el('ol', {}, guilty.map(({ name, why }) => {
      const i = views.findIndex((view) => view.name === name);
      return el('li', {}, i < 0 ? el('strong', {}, String(name)) : el('button', { type: 'button', class: 'link', onclick: () => openView(i) }, String(name)), ` ${why ?? ''}`);
    })));
}

function showModels() {
  const figures = kModelFigures.filter((figure) => models.some((model) => modelValue(model, figure) !== null));
  const row = (figure) => {
    const values = models.map((model) => modelValue(model, figure));
    const known = values.filter((value, i) => value !== null && models[i].role !== 'reference');
    const top = known.length > 1 && figure.better ? Math[figure.better === 'lower' ? 'min' : 'max'](...known) : null;
    const isTop = (value) => top !== null && direction(top, value, figure.better) === 'same';
    const differ = !known.every(isTop);
    return el('tr', {}, el('th', { scope: 'row' }, figure.label, figure.help && el('span', { class: 'help' }, figure.help)),
      values.map((value, i) => el('td', {}, differ && isTop(value) && models[i].role !== 'reference'
        ? el('strong', {}, withUnit(value, figure.unit), el('span', { class: 'best' }, ' best')) : withUnit(value, figure.unit))));
  };
  byId('models').hidden = models.length === 0;
  put(byId('models'), el('h2', { id: 'models-title' }, 'All figures of the models'),
    el('div', { class: 'scroll', tabindex: 0, role: 'region', 'aria-labelledby': 'models-title' }, el('table', {},
      el('thead', {}, el('tr', {}, el('td', {}), models.map((model, i) => el('th', { scope: 'col', title: model.path || null },
        el('span', { class: `dot ${roleClass(i)}`, 'aria-hidden': 'true' }), model.name, el('span', { class: 'help' }, roleClass(i)))))),
      el('tbody', {}, figures.map(row)))));
}

function showReading() {
  const notes = list(data.notes);
  byId('reading').hidden = false;
  put(byId('reading'), el('h2', { id: 'reading-title' }, 'How to read this'),
    notes.length > 0 && el('ul', { class: 'notes' }, notes.map((note) => el('li', {}, String(note)))),
    el('ul', {},
      data.alignment && el('li', {}, `Alignment: ${data.alignment}.`),
      el('li', {}, 'px: pixels of the photo. °: degrees. Centres in % of the extent of all cameras. The scene’s own unit has no metric meaning.'),
      el('li', {}, 'Held out: a part of the matches that took no part in the adjustment and only judges it.'),
      el('li', {}, 'Better and worse are said from 1 % of difference on.')));
  put(byId('footer'), 
    el('p', {}, data.producer ? `Made by ${data.producer}` : null, models.filter((model) => model.path).length > 0 ? ' from:' : '.'),
    el('ul', {}, models.filter((model) => model.path).map((model) => el('li', {}, `${model.name}: `, el('code', {}, model.path)))),
    data.command && el('pre', { tabindex: 0, 'aria-label': 'Command' }, data.command),
    byId('licences') && el('details', {}, el('summary', {}, 'Licence of the 3D library in this page'), el('pre', {}, byId('licences').textContent.trim())));
}

function showAll() {
  showFigures();
  showPlots();
  showViews();
  if (stageOf3D) { stageOf3D.build(); showCaption(); }
  showModels();
}

readHash();
buildScene();
showAll();
showReading();
showDetails();

function followHash() {
  readHash();
  showAll();
  if (stageOf3D) { stageOf3D.look(); setScene({}); }
  showDetails();
}
addEventListener('popstate', followHash);
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => stageOf3D && stageOf3D.build());
addEventListener('beforeprint', () => { if (stageOf3D) byId('still').src = stageOf3D.picture(); });
