// Elements from a tag, attributes and children. Strings become text nodes, so
// that nothing in an image's name is markup.

export function html(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

export function svg(tag, attributes = {}, ...children) {
  const element = document.createElementNS('http://www.w3.org/2000/svg', tag);
  return fill(element, attributes, children);
}

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith('on')) {
      element.addEventListener(name.slice(2), value);
    } else {
      element.setAttribute(name, value);
    }
  }
  element.append(...children);
  return element;
}

export function byId(id) {
  return document.getElementById(id);
}

// A table; cells are strings or nodes.
export function table(head, rows) {
  const row = (tag, cells) =>
    html('tr', {}, ...cells.map((cell) => html(tag, {}, cell)));
  return html('table', {},
    html('thead', {}, row('th', head)),
    html('tbody', {}, ...rows.map((cells) => row('td', cells))));
}

// Has the row act like a button.
export function makeSelectable(row, onSelect) {
  row.classList.add('selectable');
  row.tabIndex = 0;
  row.addEventListener('click', onSelect);
  row.addEventListener('keydown', (event) => {
    if (event.key === 'Enter') onSelect();
  });
}
