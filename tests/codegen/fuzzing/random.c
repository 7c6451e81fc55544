/* In place of libFuzzer: random RUNS SEED calls the harness with random bytes, and random FILE... with
 * those of files. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count);

static uint32_t next(uint32_t *state) /* Marsaglia, Xorshift RNGs, J. Stat. Software 8, 2003, 14 */
{
    *state ^= *state << 13;
    *state ^= *state >> 17;
    *state ^= *state << 5;
    return *state;
}

int main(int count, char **words)
{
    static uint8_t bytes[4096];
    char *rest = words[1];
    const long runs = count > 2 ? strtol(words[1], &rest, 10) : 0;
    if (count > 2 && *rest == '\0') {
        uint32_t state = (uint32_t)strtoul(words[2], NULL, 10) * 2654435761u | 1u;
        for (long n = 0; n < runs; ++n) {
            const size_t size = next(&state) % 512u;
            for (size_t i = 0; i < size; ++i) {
                bytes[i] = (uint8_t)(next(&state) >> 16);
            }
            LLVMFuzzerTestOneInput(bytes, size);
        }
        printf("%ld runs\n", runs);
        return 0;
    }
    for (int n = 1; n < count; ++n) {
        FILE *file = fopen(words[n], "rb");
        if (file == NULL) {
            return 2;
        }
        const size_t size = fread(bytes, 1, sizeof bytes, file);
        fclose(file);
        LLVMFuzzerTestOneInput(bytes, size);
    }
    return 0;
}
