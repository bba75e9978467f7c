"""python3 average_precision.py LABELS RESULTS SUMMARY: COCO's average precision by pycocotools beside that of pdk.

LABELS is the JSON file of COCO, RESULTS the results.jsonl of a record, SUMMARY its summary.json. Prints both, and exits with 1 if they
differ by more than 1e-6. Needs pycocotools.
"""

import json
import sys
from pathlib import Path

from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

NAMES = ["ap", "ap50", "ap75", "ap_small", "ap_medium", "ap_large"]


def main(labels, results, summary):
    coco = COCO(labels)
    images = {image["file_name"]: image["id"] for image in coco.dataset["images"]}
    categories = sorted(category["id"] for category in coco.dataset["categories"])
    by_cell = {}
    for line in map(json.loads, Path(results).read_text().splitlines()):
        found = by_cell.setdefault((line["label"], line["level"]), [])
        for x, y, width, height, score, number in line["measured"]["detections"]:
            box = {"image_id": images[line["frame"]], "category_id": categories[int(number)]}
            found.append({**box, "bbox": [x, y, width, height], "score": score})
    evaluation = json.loads(Path(summary).read_text())["evaluations"][0]
    rows = {(row["label"], row["level"]): row["totals"] for row in evaluation["rows"]}
    rows[None, None] = evaluation["original"]
    worst = 0
    for cell, found in by_cell.items():
        evaluated = COCOeval(coco, coco.loadRes(found), "bbox")
        evaluated.evaluate()
        evaluated.accumulate()
        evaluated.summarize()
        plain = dict(zip(NAMES, evaluated.stats[:6]))
        told = {total["name"]: -1 if total["value"] is None else total["value"] for total in rows[cell]}
        print(cell, "pycocotools", plain, "pdk", told)
        worst = max(worst, *(abs(plain[name] - told[name]) for name in NAMES))
    print("largest difference:", worst)
    return 0 if worst <= 1e-6 else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
