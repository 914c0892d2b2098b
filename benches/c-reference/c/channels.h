/* Two channels of one program: a changed bit of memory is found by comparing them. */
#ifndef CHANNELS_H
#define CHANNELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A word of memory, whatever it holds. */
typedef uint32_t __attribute__((may_alias)) memory_word;

/* Both are set to zero before they are filled, padding included, so every word of them may be compared. */
static inline bool channels_agree(const void *a, const void *b, size_t bytes)
{
    const memory_word *left = a, *right = b;

    #pragma GCC unroll 8
    for (size_t i = 0; i < bytes / sizeof *left; i++)
        if (left[i] != right[i])
            return false;
    return true;
}

#endif
