// Put before the MPI library: a program that has loaded and started MPI waits there for command lines and
// forks for each of them. All that the program does itself runs in the child as ever; what does not is the
// loading, MPI_Init and MPI_Finalize (a forked child has no part in the latter). tests/served.py speaks to
// it:
//   STICKSLIP_SERVED="IN OUT CPU WALL"   descriptors, and the seconds that a child may take
//   a request   the number of bytes (unsigned), then texts that each end in 0: folder, file for standard
//               output, file for standard error, program, its words
//   an answer   the wait status (int) and the seconds of processor time (double)
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

static int forked;

static int whole(int from, void* to, size_t size) {
  for (size_t done = 0; done < size;) {
    const ssize_t got = read(from, (char*)to + done, size - done);
    if (got <= 0) return 0;
    done += (size_t)got;
  }
  return 1;
}

static void become(char* text, size_t size, int* argc, char*** argv, unsigned cpu, unsigned wall) {
  char** words = calloc(size + 2, sizeof(char*));
  int count = 0;
  for (char* at = text; at < text + size; at += strlen(at) + 1) words[count++] = at;
  const char* files[3] = {"/dev/null", words[1], words[2]};
  for (int k = 0; k < 3; ++k) {
    const int file = open(files[k], k ? O_WRONLY | O_CREAT | O_TRUNC : O_RDONLY, 0666);
    if (file < 0 || dup2(file, k) < 0) _exit(99);
    close(file);
  }
  if (chdir(words[0]) != 0) _exit(99);
  const struct rlimit limit = {cpu, cpu + 5};  // SIGXCPU: cut; its clock then goes by ticks of milliseconds
  if (cpu > 0) setrlimit(RLIMIT_CPU, &limit);
  alarm(wall);  // SIGALRM: hangs
  *argv = words + 3;
  *argc = count - 3;
}

struct answer {
  int status;
  double seconds;
};

int MPI_Init_thread(int* argc, char*** argv, int required, int* provided) {
  int (*next)(int*, char***, int, int*) =
      (int (*)(int*, char***, int, int*))dlsym(RTLD_NEXT, "MPI_Init_thread");
  const int code = next(argc, argv, required, provided);
  const char* where = getenv("STICKSLIP_SERVED");
  int from, to;
  unsigned cpu, wall, size;
  if (!where || sscanf(where, "%d %d %u %u", &from, &to, &cpu, &wall) != 4) return code;
  unsetenv("STICKSLIP_SERVED");
  unsetenv("LD_PRELOAD");
  while (whole(from, &size, sizeof size)) {
    char* text = calloc(size + 1, 1);
    if (!text || !whole(from, text, size)) break;
    const pid_t child = fork();
    if (child < 0) break;
    if (child == 0) {
      forked = 1;
      close(from);
      close(to);
      become(text, size, argc, argv, cpu, wall);
      return code;
    }
    free(text);
    struct answer answer;
    struct rusage used;
    memset(&answer, 0, sizeof answer);
    if (wait4(child, &answer.status, 0, &used) < 0) break;
    answer.seconds = (double)(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
                     1e-6 * (double)(used.ru_utime.tv_usec + used.ru_stime.tv_usec);
    if (write(to, &answer, sizeof answer) != (ssize_t)sizeof answer) break;
  }
  _exit(0);
}

int MPI_Finalize(void) {
  int (*next)(void) = (int (*)(void))dlsym(RTLD_NEXT, "MPI_Finalize");
  return forked ? 0 : next();
}
