// A driver in C++ that steers towards the brighter half of the road.
//
//   c++ -O2 pilot.cpp -I ../include -L PDK/target/release -lpdkdriver -Wl,-rpath,PDK/target/release -o pilot
//   pdk run manual --set 'driver={"name":"process","command":["./pilot"]}'

#include <cstdio>

#include "pdk_driver.h"

int main() {
    pdk_driver *driver = pdk_driver_open(nullptr);
    pdk_frame frame;
    int found = 0;
    while (driver != nullptr && (found = pdk_driver_next(driver, &frame)) == 1) {
        double left = 0, right = 0;
        for (uint32_t y = frame.height / 2; y < frame.height; ++y) {
            const uint8_t *row = frame.pixels + static_cast<size_t>(y) * frame.width * 3;
            for (uint32_t x = 0; x < frame.width; ++x) {
                (x < frame.width / 2 ? left : right) += row[x * 3];
            }
        }
        double steering = (right - left) / (right + left + 1);
        if (pdk_driver_answer(driver, steering, 0.2) != 1) {
            found = -1;
            break;
        }
    }
    if (driver == nullptr || found < 0) {
        std::fprintf(stderr, "%s\n", pdk_driver_error());
        return 1;
    }
    pdk_driver_close(driver);
    return 0;
}
