!> Read a creep table of `hexcontact study`: loads on body 1 by creepages and spin, in the steady state of rolling.
!>
!>     type(creep_table_t) :: table
!>     call read_creep_table('creep.txt', table, status)
!>     loads = table%loads_of(-0.001d0, 0.0005d0, 0.2d0)   ! along x and y [N], torque [N m]
!>
!> The same as creep_table.py of hexcontact, whose comments explain axes, pole and interpolation. Nothing else is needed.
module creep_table
  implicit none
  private

  public :: creep_table_t, read_creep_table

  integer, parameter :: wp = kind(1.0d0)

  type :: axis_t
    real(wp), allocatable :: value(:)
  end type axis_t

  type :: creep_table_t
    type(axis_t) :: axis(3)
    real(wp) :: pole(2) = 0.0_wp, limit = 0.0_wp
    real(wp), allocatable :: load(:, :, :, :)
  contains
    procedure :: loads_of
  end type creep_table_t

contains

  !> Read a table; status is 0, or another number if the file cannot be read.
  subroutine read_creep_table(path, table, status)
    character(len=*), intent(in) :: path
    type(creep_table_t), intent(out) :: table
    integer, intent(out) :: status
    integer :: unit, count(3), d
    character(len=1) :: mark

    open (newunit=unit, file=path, status='old', action='read', iostat=status)
    if (status /= 0) return
    do
      read (unit, '(a)', iostat=status) mark
      if (status /= 0 .or. mark /= '#') exit
    end do
    backspace (unit)
    if (status == 0) read (unit, *, iostat=status) count
    if (status == 0) read (unit, *, iostat=status) table%pole, table%limit
    do d = 1, 3
      if (status /= 0) exit
      allocate (table%axis(d)%value(count(d)))
      read (unit, *, iostat=status) table%axis(d)%value
    end do
    if (status == 0) then
      allocate (table%load(3, count(1), count(2), count(3)))
      read (unit, *, iostat=status) table%load
    end if
    close (unit)
  end subroutine read_creep_table

  !> Return the loads along x and y [N] and the torque [N m] on body 1.
  pure function loads_of(self, creepage_x, creepage_y, spin) result(loads)
    class(creep_table_t), intent(in) :: self
    real(wp), intent(in) :: creepage_x, creepage_y, spin
    real(wp) :: loads(3), at(3), sign(3), over, weight(4, 3)
    integer :: first(3), d, i, j, k

    at = [creepage_x - spin*self%pole(2), creepage_y + spin*self%pole(1), spin]
    sign = 1.0_wp
    over = 1.0_wp
    if (at(3) < 0.0_wp .and. .not. self%axis(3)%value(1) < 0.0_wp) then
      sign(2:) = -1.0_wp
      at(2:) = -at(2:)
    end if
    if (at(1) < 0.0_wp .and. .not. self%axis(1)%value(1) < 0.0_wp) then
      sign(1) = -1.0_wp
      at(1) = -at(1)
    end if
    do d = 1, 3
      associate (axis => self%axis(d)%value)
        if (at(d) > 0.0_wp .and. axis(size(axis)) > 0.0_wp) over = max(over, at(d)/axis(size(axis)))
        if (at(d) < 0.0_wp .and. axis(1) < 0.0_wp) over = max(over, at(d)/axis(1))
      end associate
    end do
    do d = 1, 3
      call find_weights(self%axis(d)%value, at(d)/over, first(d), weight(:, d))
    end do
    loads = 0.0_wp
    do k = 1, 4
      do j = 1, 4
        do i = 1, 4
          loads = loads + weight(i, 1)*weight(j, 2)*weight(k, 3)*self%load(:, first(1) + i, first(2) + j, first(3) + k)
        end do
      end do
    end do
    loads = sign*loads
  end function loads_of

  !> Return the weights of four values that follow the first ones: Hermite's cubic, slopes of parabolas through three values.
  pure subroutine find_weights(axis, at, first, weight)
    real(wp), intent(in) :: axis(:), at
    integer, intent(out) :: first
    real(wp), intent(out) :: weight(4)
    real(wp) :: h, t, slope(2), x(4)
    integer :: n, left, j, k, m, low

    n = size(axis)
    left = min(max(count(axis <= at), 1), n - 1)
    first = min(max(left - 2, 0), n - 4)
    x = axis(first + 1:first + 4)
    j = left - first
    h = x(j + 1) - x(j)
    t = (at - x(j))/h
    weight = 0.0_wp
    weight(j) = (1.0_wp + 2.0_wp*t)*(1.0_wp - t)**2
    weight(j + 1) = (3.0_wp - 2.0_wp*t)*t**2
    slope = [h*t*(1.0_wp - t)**2, h*t**2*(t - 1.0_wp)]
    do k = j, j + 1
      low = merge(1, 2, k < 3)
      do m = 0, 2
        associate (here => x(low + m), p => x(low + mod(m + 1, 3)), q => x(low + mod(m + 2, 3)))
          weight(low + m) = weight(low + m) + slope(k - j + 1)*(2.0_wp*x(k) - p - q)/((here - p)*(here - q))
        end associate
      end do
    end do
  end subroutine find_weights

end module creep_table
