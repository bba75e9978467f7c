"""Labels move as the pixels do."""

import numpy
import pytest

import pdk_perturb as pdk
from pdk_perturb.transforms import Transform

SIZE = (120, 160)


def marked(x, y):
    """A grey image with a white disc about the centre of a pixel."""
    rows, columns = numpy.mgrid[: SIZE[0], : SIZE[1]]
    image = numpy.full((*SIZE, 3), 90, numpy.uint8)
    image[(columns - x) ** 2 + (rows - y) ** 2 <= 9] = 255
    return image


def middle(image):
    rows, columns = numpy.nonzero(image[:, :, 0] > 170)
    return columns.mean(), rows.mean()


@pytest.mark.parametrize(
    "perturbation",
    ["translate_image@1", "rotate_image@0", "rotate_image@2,degrees=-33", "scale_image@3", "shear_image@0", "imagenet_c_elastic_transform@4"],
)
def test_keypoints_and_boxes_go_where_the_pixels_go(perturbation):
    x, y = 70, 66
    transform = Transform(perturbation, seed=3)
    result = transform(
        image=marked(x, y),
        keypoints=[(x, y, "nose")],
        bboxes=numpy.array([[x - 3.0, y - 3.0, x + 4.0, y + 4.0]]),
        sample=1,
    )
    seen = middle(result["image"])
    (point,), (box,) = result["keypoints"], result["bboxes"]
    assert numpy.hypot(point[0] - seen[0], point[1] - seen[1]) < 1 and point[2] == "nose"
    left, top, right, bottom = box
    assert left - 1 <= seen[0] <= right and top - 1 <= seen[1] <= bottom
    assert abs((left + right) / 2 - 0.5 - seen[0]) < 2 and abs((top + bottom) / 2 - 0.5 - seen[1]) < 2


@pytest.mark.parametrize("perturbation", ["translate_image@2", "rotate_image@1", "shear_image@2", "reflection_filter@2"])
def test_masks_are_what_the_image_shows(perturbation):
    labels = numpy.add.outer(numpy.arange(SIZE[0]) // 30, numpy.arange(SIZE[1]) // 40) % 3
    colors = numpy.array([[250, 0, 0], [0, 250, 0], [0, 0, 250], [0, 0, 0]], numpy.uint8)
    result = Transform(perturbation, outside=3)(image=colors[labels], mask=labels.astype(numpy.uint8), masks=[labels], sample=0)
    pure = (result["image"][:, :, None] == colors).all(axis=3)
    seen = pure.any(axis=2)
    assert seen.mean() > 0.8
    assert (pure.argmax(axis=2) == result["mask"])[seen].mean() > 0.998
    assert (result["masks"][0] == result["mask"]).all() and result["mask"].dtype == numpy.uint8


@pytest.mark.parametrize("kind", [numpy.uint8, numpy.int64, bool, numpy.float32])
def test_masks_in_one_array_keep_their_type(image, kind):
    masks = numpy.stack([image[:, :, channel] > 120 for channel in range(3)]).astype(kind)
    moved = Transform("translate_image@2")(image=image, masks=masks)["masks"]
    assert moved.dtype == kind and moved.shape == masks.shape
    single = Transform("translate_image@2")(image=image, mask=masks[1])["mask"]
    assert (moved[1] == single).all() and not (moved == masks).all()
    none = Transform("translate_image@2")(image=image, masks=masks[:0])["masks"]
    assert none.dtype == kind and none.shape == masks[:0].shape


def test_boxes_come_as_they_were_given_and_leave_with_their_labels():
    image = numpy.zeros((100, 200, 3), numpy.uint8)
    shift = "translate_image@2,variant=corrected,share=0.5"
    edges = [[10.0, 60.0, 30.0, 80.0], [150.0, 60.0, 170.0, 80.0]]
    given = {
        "pascal_voc": edges,
        "coco": [[10.0, 60.0, 20.0, 20.0], [150.0, 60.0, 20.0, 20.0]],
        "yolo": [[0.1, 0.7, 0.1, 0.2], [0.8, 0.7, 0.1, 0.2]],
        "albumentations": [[0.05, 0.6, 0.15, 0.8], [0.75, 0.6, 0.85, 0.8]],
    }
    expected = {
        "pascal_voc": [110, 10, 130, 30],
        "coco": [110, 10, 20, 20],
        "yolo": [0.6, 0.2, 0.1, 0.2],
        "albumentations": [0.55, 0.1, 0.65, 0.3],
    }
    for form, boxes in given.items():
        transform = Transform(shift, boxes=form, label_fields=["names"])
        result = transform(image=image, bboxes=boxes, names=["a", "b"], other=7)
        assert numpy.allclose(result["bboxes"], [expected[form]]), form
        assert result["names"] == ["a"] and result["other"] == 7
    empty = Transform(shift)(image=image, bboxes=[], keypoints=numpy.zeros((0, 2)))
    assert empty["bboxes"] == [] and empty["keypoints"].shape == (0, 2)
    with pytest.raises(ValueError, match="one of pascal_voc"):
        Transform(shift, boxes="voc")


def test_what_cannot_say_where_it_moves_things_is_refused(image):
    transform = Transform("sample_pairing_filter@2")
    assert transform(image=image, label=3)["label"] == 3
    for labels in ({"mask": image[:, :, 0]}, {"bboxes": [[1, 2, 3, 4]]}, {"keypoints": [[1, 2]]}):
        with pytest.raises(pdk.Error, match="sample_pairing_filter.*cannot describe"):
            transform(image=image, **labels)
    with pytest.raises(pdk.Error, match="in a part of the frame only"):
        pdk.move_points([[1, 2]], {"name": "rotate_image", "region": {"box": [0, 0, 1, 0.5]}}, size=SIZE)


def test_what_keeps_its_place_keeps_labels(image):
    mask = (image[:, :, 0] > 120).astype(numpy.uint8)
    result = Transform("fog_filter@3")(image=image, mask=mask, bboxes=[[10, 20, 30, 40]], keypoints=[[5, 6]])
    assert (result["mask"] == mask).all() and result["bboxes"] == [[10, 20, 30, 40]] and result["keypoints"] == [[5, 6]]
    assert (pdk.source_pixels("fog_filter@3", size=(3, 4)).ravel() == range(12)).all()
