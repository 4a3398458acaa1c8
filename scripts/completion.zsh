#compdef stickslip
# Completion of stickslip for zsh: commands, scenes, and the options and values that `stickslip COMMAND -help` lists.
_stickslip() {
  local program=$words[1] command=$words[2] before=$words[CURRENT-1]
  local -a found
  if ((CURRENT == 2)); then
    found=(${(f)"$($program --help | sed -n '/^commands:/,/^$/s/^  \([a-z]*\)  *\(.*\)/\1:\2/p')"})
    _describe command found
  elif [[ $words[CURRENT] == -* ]]; then
    found=(${(f)"$($program $command -help 2>/dev/null | sed -n 's/^  \(-[a-z]\w*\) .*/\1/p')"})
    compadd -a found
  elif [[ $before == -(boundary_parameter|sweep_parameter|cycle_continue|wave_continue|fit_parameters)* ]]; then
    found=(${(f)"$($program $command -help 2>/dev/null | sed -n 's/^  -\([a-z]\w*\) \[.*\]: a finite number.*/\1/p')"})
    compset -P '*,'
    compadd -a found
  else
    [[ $before == -* ]] &&
      found=(${=$($program $command -help 2>/dev/null | sed -n "s/^  $before \[.*\]: one of \(.*\)/\1/p" | tr -d ,)})
    (($#found)) && compadd -a found || _files
  fi
}
_stickslip "$@"
