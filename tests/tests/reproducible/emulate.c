/* Loaded into pdk before everything else: whatever it starts that is called pdk, it starts on the emulator that PDK_EMULATOR names,
   with the processor that PDK_EMULATED names. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

extern char **environ;

/* The arguments with the emulator before them, or null for another program. */
static char **emulated(const char *program, char *const arguments[]) {
    const char *slash = strrchr(program, '/');
    if (strcmp(slash ? slash + 1 : program, "pdk") != 0) return NULL;
    int count = 0;
    while (arguments[count]) count++;
    char **with = calloc((size_t)count + 5, sizeof *with);
    if (!with) abort();
    with[0] = getenv("PDK_EMULATOR");
    with[1] = "-cpu";
    with[2] = getenv("PDK_EMULATED");
    with[3] = (char *)program;
    for (int i = 1; i < count; i++) with[3 + i] = arguments[i];
    return with;
}

#define SPAWN(name)                                                                                                       \
    int name(pid_t *child, const char *program, const posix_spawn_file_actions_t *actions, const posix_spawnattr_t *how,   \
             char *const arguments[], char *const variables[]) {                                                           \
        int (*spawn)(pid_t *, const char *, const posix_spawn_file_actions_t *, const posix_spawnattr_t *, char *const *,  \
                     char *const *) = dlsym(RTLD_NEXT, #name);                                                             \
        char **with = emulated(program, arguments);                                                                        \
        return spawn(child, with ? with[0] : program, actions, how, with ? with : arguments, variables);                   \
    }

SPAWN(posix_spawn)
SPAWN(posix_spawnp)

int execve(const char *program, char *const arguments[], char *const variables[]) {
    int (*run)(const char *, char *const *, char *const *) = dlsym(RTLD_NEXT, "execve");
    char **with = emulated(program, arguments);
    return run(with ? with[0] : program, with ? with : arguments, variables);
}

int execvp(const char *program, char *const arguments[]) {
    char **with = emulated(program, arguments);
    int (*run)(const char *, char *const *) = dlsym(RTLD_NEXT, "execvp");
    return run(with ? with[0] : program, with ? with : arguments);
}
