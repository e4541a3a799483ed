// SPDX-License-Identifier: BSD-3-Clause
// The figures: what they are called, their units, and which way is better (null: neither).

const kModelFigures = [
  { key: 'centre_rmse_percent', of: 'pose_error', label: 'Centre error', unit: '%', better: 'lower',
    help: 'RMSE against the reference, in % of the extent of its cameras' },
  { key: 'rotation_median_deg', of: 'pose_error', label: 'Rotation error', unit: '°', better: 'lower',
    help: 'median of relative rotations against the reference, over pairs of photos' },
  { key: 'direction_median_deg', of: 'pose_error', label: 'Direction error', unit: '°', better: 'lower',
    help: 'median of the directions from camera to camera against the reference' },
  { key: 'num_views', of: 'pose_error', label: 'Photos compared with the reference', unit: '', better: null },
  { key: 'held_out_px', label: 'Held-out error', unit: 'px', better: 'lower',
    help: 'robust mean reprojection error of tracks that took no part in the adjustment' },
  { key: 'median_px', label: 'Reprojection error', unit: 'px', better: 'lower',
    help: 'median distance between where a point is seen and where the model puts it' },
  { key: 'p90_px', label: 'Reprojection error, 9 of 10 below', unit: 'px', better: 'lower' },
  { key: 'points_on_distractors', label: 'Points on distractors', unit: '', better: 'lower',
    help: 'points that lie on what the masks exclude' },
  { key: 'num_images', label: 'Photos with a pose', unit: '', better: 'higher' },
  { key: 'coverage_percent', label: 'Photo area with points', unit: '%', better: 'higher',
    help: 'share of the 10 × 10 cells of a photo that hold an observed point, mean over photos' },
  { key: 'mean_track_length', label: 'Photos per point', unit: '', better: 'higher',
    help: 'mean track length: in how many photos a point is seen' },
  { key: 'median_angle_deg', label: 'Triangulation angle', unit: '°', better: 'higher',
    help: 'median over points of the widest angle between two rays' },
  { key: 'scale_drift_percent', label: 'Scale drift', unit: '%', better: 'lower',
    help: 'how much the scale varies over the model' },
  { key: 'num_points3D', label: 'Points', unit: '', better: null },
  { key: 'num_observations', label: 'Observations', unit: '', better: null },
];

const kViewFigures = [
  { key: 'held_out_px', label: 'Held-out error', unit: 'px', better: 'lower' },
  { key: 'median_px', label: 'Reprojection error, median', unit: 'px', better: 'lower' },
  { key: 'rotation_error_deg', label: 'Rotation, error against the reference', unit: '°', better: 'lower' },
  { key: 'centre_error_percent', label: 'Centre, error against the reference', unit: '%', better: 'lower' },
  { key: 'rotation_change_deg', label: 'Rotation, change', unit: '°', better: null },
  { key: 'centre_change_percent', label: 'Centre, change', unit: '%', better: null },
  { key: 'num_observations', label: 'Observations', unit: '', better: null },
  { key: 'observations_on_distractors', label: 'Observations on distractors', unit: '', better: 'lower' },
  { key: 'coverage_percent', label: 'Photo area with points', unit: '%', better: 'higher' },
  { key: 'mean_track_length', label: 'Photos per point', unit: '', better: 'higher' },
  { key: 'median_angle_deg', label: 'Triangulation angle', unit: '°', better: 'higher' },
];

const kStatus = {
  refined: { sign: '✓', text: 'refined', tone: 'good' },
  kept: { sign: '=', text: 'kept as it was', tone: 'plain' },
  rejected: { sign: '✕', text: 'rejected', tone: 'bad' },
  missing: { sign: '∅', text: 'not in the model', tone: 'bad' },
};

const data = JSON.parse(byId('data').textContent);
const models = list(data.models);
const views = list(data.views);

const modelValue = (model, figure) => {
  const owner = model && (figure.of ? model[figure.of] : model);
  return owner && isNumber(owner[figure.key]) ? owner[figure.key] : null;
};
const viewValue = (view, modelIdx, key) => {
  const entry = list(view.by_model)[modelIdx];
  return entry && isNumber(entry[key]) ? entry[key] : null;
};

// The two models that are compared, as indices; -1: there is none. The reference is the last choice.
function chosenPair() {
  const others = models.map((model, i) => i).filter((i) => models[i].role !== 'reference');
  const withRole = (role) => others.find((i) => models[i].role === role);
  const asked = (text) => (/^\d+$/.test(text) && Number(text) < models.length ? Number(text) : undefined);
  const after = asked(state.b) ?? withRole('after') ?? others[others.length - 1] ?? models.length - 1;
  const before = asked(state.a) ?? withRole('before') ?? others.find((i) => i !== after) ?? -1;
  return before === after ? [-1, after] : [before, after];
}

const referenceModel = () => models.findIndex((model) => model.role === 'reference');
const roleClass = (modelIdx) => {
  const [before, after] = chosenPair();
  return modelIdx === before ? 'before' : modelIdx === after ? 'after'
    : modelIdx === referenceModel() ? 'reference' : 'other';
};

// 'better', 'worse', 'same', or for figures without a better side 'more', 'fewer'; null if unknown.
// Differences below 1 % are none that a reader should act on.
function direction(before, after, better) {
  if (!isNumber(before) || !isNumber(after)) return null;
  const size = Math.max(Math.abs(before), Math.abs(after));
  if (Math.abs(after - before) <= 0.01 * size) return 'same';
  if (!better) return after > before ? 'more' : 'fewer';
  return after > before === (better === 'higher') ? 'better' : 'worse';
}

const kDirections = {
  better: ['✓', 'better'], worse: ['✕', 'worse'], same: ['=', 'same'], more: ['↑', 'more'], fewer: ['↓', 'fewer'],
};

// "9.3 × lower", "14 % higher": what a reader would say.
function changeInWords(before, after) {
  if (!isNumber(before) || !isNumber(after) || before === after) return '';
  if (before === 0 || after === 0) return after > before ? `up from ${formatNumber(before)}` : 'down to none';
  const ratio = after / before;
  if (ratio >= 2) return `${formatTick(ratio, 2)}× higher`;
  if (ratio > 0 && ratio <= 0.5) return `${formatTick(1 / ratio, 2)}× lower`;
  const percent = Math.abs(ratio - 1) * 100;
  return `${formatTick(percent, 2)} % ${ratio > 1 ? 'higher' : 'lower'}`;
}

// The error that says most about a photo, and that most photos have.
const errorKey = views.some((view) => list(view.by_model).some((m) => m && isNumber(m.held_out_px)))
  ? 'held_out_px' : 'median_px';
const viewFigure = (key) => kViewFigures.find((figure) => figure.key === key);

function viewStatus(view) {
  const entry = list(view.by_model)[chosenPair()[1]];
  if (!entry) return 'missing';
  return kStatus[entry.status] ? entry.status : null;
}

function badge(status) {
  const { sign, text, tone } = kStatus[status] || {};
  return text ? el('span', { class: `badge ${tone}` }, el('span', { 'aria-hidden': 'true' }, sign), ` ${text}`) : null;
}
