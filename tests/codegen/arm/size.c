/* The least program that calls the vehicle, or with LAW the controller, to see what it takes. */
#include "swb_vehicle.h"

#ifdef LAW
static swb_controller controller;
#else
static swb_vehicle vehicle;
#endif
volatile swb_seen seen;
volatile float said;

int main(void)
{
    for (;;) {
        swb_seen now = seen;
#ifdef LAW
        said = swb_controller_tick(&controller, now.depth, now.volume, said);
#else
        said = swb_vehicle_tick(&vehicle, &now, said);
#endif
    }
}
