// Numbers as text. What is not known is null, and a dash.

const kDash = '–';

export function fixed(value, decimals) {
  return value === null || value === undefined || Number.isNaN(value) ?
    kDash : value.toFixed(decimals);
}

// Pixels with four decimals, as the command line prints them.
export function pixels(value) {
  return fixed(value, 4);
}

// Rounded downwards: more than a lower bound is not proved.
export function lowerBound(value) {
  return pixels(value === null ? null : Math.floor(value * 1e4) / 1e4);
}

export function percent(ratio) {
  if (ratio === null || ratio === undefined) return kDash;
  return 100 * ratio < 1e-4 ? '< 0.0001 %' : `${fixed(100 * ratio, 4)} %`;
}

export function count(value) {
  return value === null || value === undefined ?
    kDash : value.toLocaleString('en-US');
}

export function counted(value, noun, nouns = `${noun}s`) {
  return `${count(value)} ${value === 1 ? noun : nouns}`;
}

export function seconds(value) {
  return value === null || value === undefined ? kDash :
    `${fixed(value, 2)} s`;
}

export function significant(value, digits) {
  return value === null || !Number.isFinite(value) ?
    kDash : String(Number(value.toPrecision(digits)));
}
