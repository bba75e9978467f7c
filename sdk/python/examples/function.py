"""A driver that is any function: it steers towards the brighter half of the road."""

import pdk_driver


def drive(frame, context):
    road = frame[frame.shape[0] // 2 :, :, 0]
    left, right = (half.sum(dtype=float) for half in (road[:, : road.shape[1] // 2], road[:, road.shape[1] // 2 :]))
    return (right - left) / (right + left + 1), 0.2


pdk_driver.serve(drive)
