#!/usr/bin/env bash
# What `krot --help` prints in its other formats, as files: FOLDER/man1/*.1.gz,
# FOLDER/krot.bash and FOLDER/_krot; and beside them changelog.gz.
#
# Usage: tools/docs/help_pages.sh KROT FOLDER
set -euo pipefail

krot=$1
folder=$2

rm -rf "$folder/man1"
mkdir -p "$folder/man1"
commands=$("$krot" help | awk '/^Commands:/ { on = 1; next }
                               /^$/ { on = 0 }
                               on && $1 != "help" { print $1 }')
"$krot" --help=man >"$folder/man1/krot.1"
for command in $commands; do
  "$krot" "$command" --help=man >"$folder/man1/krot-$command.1"
done
gzip -9nf "$folder"/man1/*.1
gzip -9nc "$(dirname "${BASH_SOURCE[0]}")/../../CHANGELOG.md" \
  >"$folder/changelog.gz"
"$krot" --help=bash >"$folder/krot.bash"
"$krot" --help=zsh >"$folder/_krot"
