/* Drives for pdk from C and C++. Link with -lpdkdriver.
 *
 * pdk starts such a program with driver = { name = "process", command = { "./pilot" } } in a pipeline. It opens the exchange, takes
 * one frame after the other, and answers each before it takes the next.
 */
#ifndef PDK_DRIVER_H
#define PDK_DRIVER_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The exchange with pdk. It is used by one thread at a time. */
typedef struct pdk_driver pdk_driver;

/* A frame, and what is known besides. */
typedef struct pdk_frame {
    /* The first pixel: RGB, a byte each, rows from top to bottom without gaps, in shared memory. It is valid until the next call. */
    const uint8_t *pixels;
    uint32_t width;
    uint32_t height;
    /* Number of the scenario in this process, from 1. With each new one the driver has to forget what it remembers. */
    uint64_t scenario;
    /* Number of the frame within its scenario, from 0. */
    uint64_t frame_index;
    /* Simulation time in seconds since the start of the scenario. */
    double time;
    /* The vehicle's speed in metres a second; not a number where it is not known. */
    double speed;
} pdk_frame;

/* Opens the exchange in this folder; NULL for the one that pdk has named to a program that it started. NULL where that fails: see
 * pdk_driver_error. */
pdk_driver *pdk_driver_open(const char *folder);

/* Waits for the next frame. 1 if there is one, 0 if pdk is done, -1 if something fails: see pdk_driver_error. */
int pdk_driver_next(pdk_driver *driver, pdk_frame *frame);

/* Answers the frame: steering from -1 (left) to 1 (right), throttle from -1 (brake) to 1. 1, or -1 where something fails. */
int pdk_driver_answer(pdk_driver *driver, double steering, double throttle);

/* What failed last in this thread; an empty text where nothing did. It is valid until the next call. */
const char *pdk_driver_error(void);

/* Closes the exchange. */
void pdk_driver_close(pdk_driver *driver);

#ifdef __cplusplus
}
#endif

#endif
