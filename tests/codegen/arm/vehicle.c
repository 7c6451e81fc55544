/* On an emulated Cortex-M: reads what is seen and the depth asked for at each tick from a file, calls
 * the vehicle, writes its command and its reasons to another. */
#include "swb_vehicle.h"

#include <stdio.h>

static swb_vehicle vehicle;

static struct {
    swb_seen seen;
    float reference;
} in;

static struct {
    float command;
    uint32_t reasons;
} out;

int main(int count, char **words)
{
    FILE *frames = fopen(count > 2 ? words[1] : "", "rb");
    FILE *answers = fopen(count > 2 ? words[2] : "", "wb");
    if (frames == NULL || answers == NULL) {
        return 2;
    }
    swb_vehicle_begin(&vehicle, false);
    while (fread(&in, sizeof in, 1, frames) == 1) {
        out.command = swb_vehicle_tick(&vehicle, &in.seen, in.reference);
        out.reasons = vehicle.reasons;
        fwrite(&out, sizeof out, 1, answers);
    }
    return fclose(answers) != 0;
}
