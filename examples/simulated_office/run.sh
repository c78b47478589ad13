#!/usr/bin/env bash
# A simulated office, visited twice: recorded, mapped, asked, compared, and held against the exact truth.
#
#   ./run.sh [FOLDER [SEED]]        two to six minutes on two CPU cores; FOLDER is simulated-office if none is given
set -euo pipefail
folder=${1:-simulated-office}
seed=${2:-1}
export SUPERMAP_DB=$folder/office.db

# What an earlier run left in the folder is replaced; what anything else left there is not.
for file in truth.json monday.mcap tuesday.mcap office.db; do
    if [ -e "$folder/$file" ] && ! head -c 200 "$folder/truth.json" 2>/dev/null | grep -q '"scenario":"office-twice"'; then
        echo "error: $file would be overwritten ($folder): name another folder" >&2
        exit 1
    fi
done

# A world and two recordings of it, a day apart, each in an odometry frame of its own. Between the visits a plant, a
# trash can and a chair have gone, a bucket, a cart and a safety sign have come, and three things stand elsewhere.
# What is exactly true goes into truth.json. The seed decides everything.
supermap simulate office-twice --out "$folder" --seed "$seed" --overwrite

# Is there all that a build needs? This is the first command for a recording of your own, too.
supermap inspect "$folder/monday.mcap"

# Both recordings into one memory. The detections recorded in them are used; the truth is not looked at.
rm -f "$SUPERMAP_DB"*
supermap build "$folder/monday.mcap" "$folder/tuesday.mcap" --detector recorded

# Questions in plain words: what there is, how many, in relation to something else, and how it used to be.
supermap query "how many chairs"
supermap query "laptop on the desk"
supermap query "trash can earlier"
supermap query "piano"

# What changed between the two visits, and what nobody can say.
supermap diff

# How good is it all? The map against the truth: a table for each family of metrics, the same as JSON, and a picture of
# the map over the truth and of every changed place over time.
supermap eval all "$SUPERMAP_DB" "$folder/truth.json" --plot "$folder/evaluation.png"
supermap eval all "$SUPERMAP_DB" "$folder/truth.json" --json > "$folder/evaluation.json"
