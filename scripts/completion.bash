# Completion of stickslip for bash: commands, scenes, and the options and values that `stickslip COMMAND -help` lists.
_stickslip() {
  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} command=${COMP_WORDS[1]} program=${COMP_WORDS[0]}
  COMPREPLY=()
  if ((COMP_CWORD == 1)); then
    mapfile -t COMPREPLY < <(compgen -W "$("$program" --help | sed -n '/^commands:/,/^$/s/^  \([a-z]*\) .*/\1/p')" -- "$word")
  elif [[ $word == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$("$program" "$command" -help 2>/dev/null | sed -n 's/^  \(-[a-z]\w*\) .*/\1/p')" -- "$word")
  else
    local values=
    [[ $before == -* ]] &&
      values=$("$program" "$command" -help 2>/dev/null | sed -n "s/^  $before \[.*\]: one of \(.*\)/\1/p" | tr -d ,)
    if [ -n "$values" ]; then mapfile -t COMPREPLY < <(compgen -W "$values" -- "$word")
    else mapfile -t COMPREPLY < <(compgen -f -- "$word"); fi
  fi
}
complete -o filenames -F _stickslip stickslip
