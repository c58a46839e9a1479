// Puts the page together.

import { boxesNote, boxesTable } from './boxes.js';
import { viewerControls, viewerNotes } from './controls.js';
import { convergenceChart } from './convergence.js';
import { histogramChart, imagesChart, tailChart } from './curves.js';
import { decodeModel, isComparison, modelLabels, readJson } from './data.js';
import { byId, html } from './dom.js';
import { errorsTable } from './errors_table.js';
import { cards, differencesTable, factsTable } from './facts.js';
import { counted } from './format.js';
import { imagesTable, pairImages, supportTable } from './lists.js';
import { pairsFigure, pairsNote } from './pairs.js';
import { profileChart, profileTable } from './profile.js';
import { rotationSentence, suspectRows } from './suspects.js';
import { scope, verdict } from './verdict.js';
import {
  badImagesTable, verdictsByName, verdictsNote, wrongObservationsTable,
} from './verdicts.js';
import { Viewer } from './viewer.js';

function showViewer(contents) {
  const stage = html('div', { class: 'stage' });
  try {
    const viewer = new Viewer(stage, contents);
    byId('scene').append(viewerControls(viewer), stage,
      viewerNotes(contents.models));
    return (selected) => viewer.show(selected);
  } catch (error) {
    byId('scene').append(html('p', { class: 'note' },
      `The 3D view needs WebGL 2, which this browser does not offer (${
        error.message}).`));
    return () => {};
  }
}

function showSupport(support, show) {
  if (support.length === 0) {
    byId('support-section').hidden = true;
    return;
  }
  byId('support-note').textContent =
    `${counted(support.length, 'observation')} alone set the proved bound, ` +
    'worst first. Click one to see it in the 3D view.';
  byId('support').append(supportTable(support, show));
}

function showSuspects({ rotation_suspect: rotation }, suspects, show) {
  byId('suspects-section').hidden = !rotation && suspects.length === 0;
  byId('rotation-suspect').hidden = !rotation;
  if (rotation) {
    byId('rotation-suspect').append(rotationSentence(rotation), ' ',
      html('button', {
        type: 'button',
        onclick: () => show({ imageName: rotation.image_name }),
      }, 'Show'));
  }
  byId('crops-note').hidden = suspects.length === 0;
  byId('suspects').append(...suspectRows(suspects, show));
}

function showVerdicts(report, show) {
  const isChecked = report.command === 'model_checker';
  byId('verdicts-section').hidden = !isChecked;
  if (!isChecked) return;
  byId('verdicts-note').textContent = verdictsNote(report);
  byId('bad-images').append(badImagesTable(report, show));
  byId('wrong-observations').append(wrongObservationsTable(report, show));
}

function showPairs({ database }, view, show) {
  byId('pairs-section').hidden = !database || !view;
  if (!database || !view) return;
  byId('pairs-note').textContent = pairsNote(database);
  byId('pairs').append(pairsFigure(database, view, show));
}

function showCourse(report) {
  const chart = report.iterations ? convergenceChart(report) : null;
  if (chart) byId('convergence').append(chart);
  byId('course').hidden = !chart;
}

function showProfile({ profile }) {
  byId('profile-section').hidden = !profile;
  if (!profile) return;
  byId('profile-chart').append(profileChart(profile));
  byId('profile').append(profileTable(profile));
}

function showBoxes(report, show) {
  byId('boxes-section').hidden = !report.boxes?.length;
  if (!report.boxes?.length) return;
  byId('boxes-note').textContent = boxesNote(report);
  byId('boxes').append(boxesTable(report.boxes, show));
}

function showDifferences(report) {
  byId('differences-section').hidden = !isComparison(report);
  if (isComparison(report)) {
    byId('differences').append(differencesTable(report));
  }
}

function showPage(report, models) {
  const labels = modelLabels(report);
  const support = report.support ?? [];
  document.title = `KROT: ${verdict(report)}`;
  byId('command').textContent = `krot ${report.command}`;
  byId('version').textContent = `KROT ${report.version}`;
  byId('verdict').textContent = verdict(report);
  byId('scope').textContent = scope(report);
  byId('cards').append(...cards(report, labels));
  byId('errors').append(errorsTable(report, labels));
  byId('curves').append(histogramChart(models, labels),
    tailChart(models, labels));
  byId('facts').append(factsTable(report));
  showProfile(report);
  showDifferences(report);
  showCourse(report);
  const show = showViewer(
    {
      models, labels, support, boxes: report.boxes ?? [],
      levels: report.profile?.levels ?? [],
      verdicts: verdictsByName(report),
      wrongPoints: (report.observations ?? []).map((one) => one.point3D_id),
      sharesPoints: !isComparison(report),
    });
  showVerdicts(report, show);
  showPairs(report, readJson('krot-pairs'), show);
  showBoxes(report, show);
  showSupport(support, show);
  showSuspects(report, readJson('krot-crops'), show);
  byId('image-chart').append(imagesChart(pairImages(models), labels,
    (imageName) => show({ imageName })));
  byId('images').append(imagesTable(models, labels, show));
}

const { before, after } = readJson('krot-models');
showPage(readJson('krot-report'), [before, after].map(decodeModel));
