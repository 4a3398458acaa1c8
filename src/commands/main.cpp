#include "stickslip/commands/program.hpp"

int main(int argc, char** argv) { return stickslip::main(argc, argv); }
