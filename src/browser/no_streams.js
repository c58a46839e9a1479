// JSZip looks for Node's streams, which browsers do not have.
module.exports = {};
